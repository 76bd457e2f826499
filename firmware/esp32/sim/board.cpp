#include "board.hpp"

#include <algorithm>
#include <cmath>

namespace wheelwire::sim {

namespace {

constexpr double kNanosecond = 1e-9;
constexpr auto kPhysicsStep = static_cast<Nanoseconds>(kMaxPhysicsStep / kNanosecond);

}  // namespace

uint16_t Battery::millivolts() {
  return static_cast<uint16_t>(std::lround(std::max(0.0, volts - sag_v) * 1e3));
}

ChipState::ChipState(const std::array<Quadrature, 2>& encoders, const EncoderWiring& wiring)
    : counters{PulseCounter(encoders[wiring.a_of(kLeft)].a(), encoders[wiring.b_of(kLeft)].b()),
               PulseCounter(encoders[wiring.a_of(kRight)].a(), encoders[wiring.b_of(kRight)].b())} {
}

void ChipState::fit(Stage stage, Stage wired) {
  bridges = {Bridge(wired), Bridge(wired)};
  const StageTable& table = *table_of(stage);
  left_motor.emplace(bridges[kLeft], table);
  right_motor.emplace(bridges[kRight], table);
}

SimulatedBoard::SimulatedBoard(uint64_t seed)
    : encoders{Quadrature(mix(seed)), Quadrature(mix(seed + 1))} {
  chip_.emplace(encoders, wiring);
}

void SimulatedBoard::run_until(Nanoseconds end, bool listening) {
  const std::array<BridgeState, 2> applied = bridges();
  const Nanoseconds start = now_;
  while (now_ < end) {
    const Nanoseconds step = std::min(kPhysicsStep, end - now_);
    plant.step(static_cast<double>(step) * kNanosecond, applied);
    for (const Side side : kSides) turn_encoder(side);
    now_ += step;
    if (is_browned_out()) break;
  }
  battery.sag_v = plant.sag_v();
  line.carry(static_cast<double>(now_ - start) * kNanosecond, listening);
}

void SimulatedBoard::turn_encoder(Side side) {
  encoders[side].turn(plant.turned_rad(side), counts_per_revolution, [&](bool a, bool b) {
    if (wiring.is_right()) {
      chip_->counters[side].set_levels(a, b);
      return;
    }
    for (const Side counter : kSides) {
      chip_->counters[counter].set_levels(encoders[wiring.a_of(counter)].a(),
                                          encoders[wiring.b_of(counter)].b());
    }
  });
}

void SimulatedBoard::reset() {
  chip_.emplace(encoders, wiring);
  line.reset();
  clock.reset(now_);
}

EncoderCounts SimulatedBoard::latch() {
  return {.t_us = device_us(),
          .left = chip_->counters[kLeft].value(),
          .right = chip_->counters[kRight].value()};
}

void SimulatedBoard::take_up(const BoardDescription& description) {
  chip_->fit(description.stage,
             wired_stage < 0 ? description.stage : static_cast<Stage>(wired_stage));
}

Hal SimulatedBoard::hal() {
  return {.left_motor = *chip_->left_motor,
          .right_motor = *chip_->right_motor,
          .encoders = *this,
          .line = line,
          .store = store,
          .latches = latches,
          .latch_store = latch_store,
          .estop = estop,
          .battery = battery};
}

std::array<BridgeState, 2> SimulatedBoard::bridges() const {
  return {chip_->bridges[kLeft].state(), chip_->bridges[kRight].state()};
}

uint32_t SimulatedBoard::hard_switches() const {
  return chip_->bridges[kLeft].hard_switches() + chip_->bridges[kRight].hard_switches();
}

bool SimulatedBoard::drives() const {
  return chip_->bridges[kLeft].state().drives() || chip_->bridges[kRight].state().drives();
}

}  // namespace wheelwire::sim
