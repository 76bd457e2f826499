// The chip's peripherals, connected to the plant: every interface that the core uses.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "board_rules.hpp"
#include "bridge_port.hpp"
#include "clock.hpp"
#include "counter.hpp"
#include "hal.hpp"
#include "line.hpp"
#include "plant.hpp"
#include "power_stage.hpp"
#include "quadrature.hpp"
#include "store.hpp"

namespace wheelwire::sim {

class EstopContact final : public EstopInput {
 public:
  bool open = false;
  bool is_open() override { return open; }
};

class Battery final : public BatterySense {
 public:
  double volts = 7.4;  ///< Without a load; 0: not measured.
  double sag_v = 0.0;  ///< Less by this.
  uint16_t millivolts() override;
};

/// Which encoder's wires lead to each counter of the chip.
struct EncoderWiring {
  bool swapped = false;  ///< Each counter has the other wheel's encoder.
  int both_on = 0;       ///< Both counters have one encoder: 1 the left one, 2 the right one.
  bool mixed = false;    ///< Each counter has A of one encoder and B of the other.

  bool is_right() const { return !swapped && both_on == 0 && !mixed; }
  Side a_of(Side counter) const {
    if (both_on != 0) return both_on == 1 ? kLeft : kRight;
    return swapped ? other(counter) : counter;
  }
  Side b_of(Side counter) const { return mixed ? other(a_of(counter)) : a_of(counter); }
};

/// What a reset of the chip loses: pin levels and counters.
struct ChipState {
  ChipState(const std::array<Quadrature, 2>& encoders, const EncoderWiring& wiring);
  ChipState(const ChipState&) = delete;
  ChipState& operator=(const ChipState&) = delete;

  /// The firmware knows its board: `stage` is the one that it drives, `wired` the one that is
  /// there.
  void fit(Stage stage, Stage wired);

  std::array<Bridge, 2> bridges;
  std::optional<PowerStage> left_motor{std::in_place, bridges[kLeft]};
  std::optional<PowerStage> right_motor{std::in_place, bridges[kRight]};
  std::array<PulseCounter, 2> counters;
};

class SimulatedBoard final : public EncoderPort {
 public:
  explicit SimulatedBoard(uint64_t seed);
  SimulatedBoard(const SimulatedBoard&) = delete;
  SimulatedBoard& operator=(const SimulatedBoard&) = delete;

  Plant plant;
  std::array<Quadrature, 2> encoders;
  EncoderWiring wiring;
  int counts_per_revolution = 360;
  double brownout_v = 0.0;  ///< The chip needs a supply of at least this.
  Line line;
  Store store;
  Store board_store;
  RetainedMemory latches;
  Store latch_store;
  int wired_stage = -1;  ///< Stage that is there; -1: the one that the firmware's board says.
  EstopContact estop;
  Battery battery;
  DeviceClock clock;

  /// Keeps what is saved in this file, and the board and a latched e-stop in files beside it.
  void use_files(const std::string& path) {
    store.use_file(path);
    board_store.use_file(path + ".board");
    latch_store.use_file(path + ".latch");
  }

  Nanoseconds now() const { return now_; }
  uint64_t device_us() const { return clock.microseconds(now_); }

  /// Advances physics and line to `end`, or to a brownout. A device that is not `listening` loses
  /// what it is sent.
  void run_until(Nanoseconds end, bool listening);
  /// Outputs off, counters and clock from 0, the line's buffers lost. The store is kept.
  void reset();

  /// Drives the power stages as this board says, from now on.
  void take_up(const BoardDescription& description);

  EncoderCounts latch() override;
  Hal hal();
  std::array<BridgeState, 2> bridges() const;
  bool drives() const;
  uint32_t hard_switches() const;
  bool is_browned_out() const { return plant.supply_v() < brownout_v; }

 private:
  void turn_encoder(Side side);

  std::optional<ChipState> chip_;
  Nanoseconds now_ = 0;
};

}  // namespace wheelwire::sim
