#include "board.hpp"

#include <algorithm>
#include <cmath>

namespace wheelwire::sim {

namespace {

constexpr double kNanosecond = 1e-9;
constexpr auto kPhysicsStep = static_cast<Nanoseconds>(kMaxPhysicsStep / kNanosecond);

}  // namespace

uint16_t Battery::millivolts() { return static_cast<uint16_t>(std::lround(volts * 1e3)); }

ChipState::ChipState(const std::array<Quadrature, 2>& encoders)
    : counters{PulseCounter(encoders[kLeft].a(), encoders[kLeft].b()),
               PulseCounter(encoders[kRight].a(), encoders[kRight].b())} {}

SimulatedBoard::SimulatedBoard(uint64_t seed)
    : encoders{Quadrature(mix(seed)), Quadrature(mix(seed + 1))} {
  chip_.emplace(encoders);
}

void SimulatedBoard::run_until(Nanoseconds end, bool listening) {
  const std::array<BridgePins, 2> applied = pins();
  const Nanoseconds start = now_;
  while (now_ < end) {
    const Nanoseconds step = std::min(kPhysicsStep, end - now_);
    plant.step(static_cast<double>(step) * kNanosecond, applied);
    for (const Side side : kSides) {
      encoders[side].turn(plant.turned_rad(side), counts_per_revolution,
                          [&](bool a, bool b) { chip_->counters[side].set_levels(a, b); });
    }
    now_ += step;
  }
  line.carry(static_cast<double>(now_ - start) * kNanosecond, listening);
}

void SimulatedBoard::reset() {
  chip_.emplace(encoders);
  line.reset();
  clock.reset(now_);
}

EncoderCounts SimulatedBoard::latch() {
  return {.t_us = device_us(),
          .left = chip_->counters[kLeft].value(),
          .right = chip_->counters[kRight].value()};
}

Hal SimulatedBoard::hal() {
  return {.left_motor = chip_->left_motor,
          .right_motor = chip_->right_motor,
          .encoders = *this,
          .line = line,
          .store = store,
          .estop = estop,
          .battery = battery};
}

std::array<BridgePins, 2> SimulatedBoard::pins() const {
  return {chip_->bridges[kLeft].pins(), chip_->bridges[kRight].pins()};
}

bool SimulatedBoard::drives() const {
  return chip_->bridges[kLeft].pins().drives() || chip_->bridges[kRight].pins().drives();
}

}  // namespace wheelwire::sim
