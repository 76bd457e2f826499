// The motors, encoders and contact that are wired to this chip.
#pragma once

#include "board_rules.hpp"
#include "encoders.hpp"
#include "estop_contact.hpp"
#include "parameters.hpp"
#include "power_stage.hpp"
#include "stage_pins.hpp"

namespace wheelwire {

struct WiredRobot {
  static constexpr uint32_t kCapabilities = capability::kEstopInput;

  /// The board decides what the motors do; nothing is driven before start().
  explicit WiredRobot(const BoardDescription& with)
      : board(with),
        left_motor(left_pins, *table_of(with.stage)),
        right_motor(right_pins, *table_of(with.stage)) {}

  /// Starts as much as possible. False: a peripheral did not start, and the motors stay off.
  bool start(const Parameters& parameters) {
    const auto whole = [&](ParameterId id) { return static_cast<uint32_t>(parameters.get(id)); };
    const bool estop_started = estop.start(board);
    const bool encoders_started = encoders.start(board, whole(ParameterId::kGlitchFilterNs));
    const bool motors_started = timer.create(whole(ParameterId::kPwmFrequencyHz)) &&
                                left_pins.start(timer, board, 0) &&
                                right_pins.start(timer, board, 1) && timer.run();
    return estop_started && encoders_started && motors_started;
  }

  const BoardDescription& board;
  PwmTimer timer;
  StagePins left_pins;
  StagePins right_pins;
  PowerStage left_motor;
  PowerStage right_motor;
  Encoders encoders;
  EstopContact estop;
};

}  // namespace wheelwire
