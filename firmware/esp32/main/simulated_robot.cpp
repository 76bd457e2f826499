#include "simulated_robot.hpp"

#include <algorithm>

#include "clock.hpp"

namespace wheelwire {
namespace {

/// One physics step per control period, since the chip computes doubles in software. The default
/// robot's time constant is a hundred times as long. After a longer gap simulated time is lost.
constexpr double kMaxStepS = 2e-3;

}  // namespace

void SimulatedEncoders::start(int counts_per_revolution) {
  counts_per_revolution_ = counts_per_revolution;
  last_us_ = now_us();
}

EncoderCounts SimulatedEncoders::latch() {
  const uint64_t t_us = now_us();
  const double elapsed_s = static_cast<double>(t_us - last_us_) * 1e-6;
  last_us_ = t_us;
  plant_.step(std::min(elapsed_s, kMaxStepS), {left_bridge_.state(), right_bridge_.state()});
  turn(left_, plant_.turned_rad(sim::kLeft));
  turn(right_, plant_.turned_rad(sim::kRight));
  return {.t_us = t_us, .left = left_.counter.value(), .right = right_.counter.value()};
}

void SimulatedEncoders::turn(Wheel& wheel, double angle_rad) {
  wheel.encoder.turn(angle_rad, counts_per_revolution_,
                     [&](bool a, bool b) { wheel.counter.set_levels(a, b); });
}

bool SimulatedRobot::start(const Parameters& parameters) {
  encoders.start(static_cast<int>(parameters.get(ParameterId::kCountsPerRevolution)));
  return true;
}

}  // namespace wheelwire
