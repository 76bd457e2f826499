// The chip's peripherals, connected to the plant: every interface that the core uses.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "bridge_port.hpp"
#include "clock.hpp"
#include "counter.hpp"
#include "hal.hpp"
#include "l298n.hpp"
#include "line.hpp"
#include "plant.hpp"
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
  double volts = 7.4;
  uint16_t millivolts() override;
};

/// What a reset of the chip loses: pin levels and counters.
struct ChipState {
  explicit ChipState(const std::array<Quadrature, 2>& encoders);
  ChipState(const ChipState&) = delete;
  ChipState& operator=(const ChipState&) = delete;

  std::array<Bridge, 2> bridges;
  L298n left_motor{bridges[kLeft]};
  L298n right_motor{bridges[kRight]};
  std::array<PulseCounter, 2> counters;
};

class SimulatedBoard final : public EncoderPort {
 public:
  explicit SimulatedBoard(uint64_t seed);
  SimulatedBoard(const SimulatedBoard&) = delete;
  SimulatedBoard& operator=(const SimulatedBoard&) = delete;

  Plant plant;
  std::array<Quadrature, 2> encoders;
  int counts_per_revolution = 360;
  Line line;
  Store store;
  EstopContact estop;
  Battery battery;
  DeviceClock clock;

  Nanoseconds now() const { return now_; }
  uint64_t device_us() const { return clock.microseconds(now_); }

  /// Advances physics and line to `end`. A device that is not `listening` loses what it is sent.
  void run_until(Nanoseconds end, bool listening);
  /// Outputs off, counters and clock from 0, the line's buffers lost. The store is kept.
  void reset();

  EncoderCounts latch() override;
  Hal hal();
  std::array<BridgePins, 2> pins() const;
  bool drives() const;

 private:
  std::optional<ChipState> chip_;
  Nanoseconds now_ = 0;
};

}  // namespace wheelwire::sim
