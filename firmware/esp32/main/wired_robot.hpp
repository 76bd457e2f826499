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
  bool start(const Parameters& parameters);

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
