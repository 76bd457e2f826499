#include "motor.hpp"

#include <cmath>

#include "check.hpp"

using namespace wheelwire::sim;

namespace {

constexpr double kTorquePerAmp = 0.09;

WheelMotion step(const WheelMotion& wheel, double current, const WheelLoad& load = {}) {
  return step_wheel(wheel, 1e-4, 5e-4, current, kTorquePerAmp, Friction{}, load);
}

}  // namespace

TEST(motor_constants_reproduce_the_rating) {
  const MotorRating rating;
  const BridgeModel bridge;
  const MotorConstants motor = derive(rating, bridge, Friction{});
  const BridgeState full = {.on = Winding::kForward, .duty = 1.0};
  const double stall = bridge.current(full, 0.0, motor.winding_ohm);
  CHECK(std::abs(stall - rating.stall_current_a) < 1e-9);
  CHECK(std::abs(stall * motor.torque_nm_per_a - rating.stall_torque_nm) < 1e-9);
  const double no_load = 200.0 * 2.0 * 3.14159265358979 / 60.0;
  const double current = bridge.current(full, motor.emf_vs * no_load, motor.winding_ohm);
  CHECK(std::abs(current * motor.torque_nm_per_a - Friction{}.torque(no_load)) < 1e-9);
}

TEST(static_friction_holds_at_exactly_zero) {
  WheelMotion wheel;
  const double breakaway = Friction{}.static_nm / kTorquePerAmp;
  for (int i = 0; i < 1000; ++i) wheel = step(wheel, (i % 2 == 0 ? 0.99 : -0.99) * breakaway);
  CHECK(wheel.speed == 0.0);
  CHECK(step(wheel, 1.01 * breakaway).speed > 0.0);
  CHECK(step(wheel, -1.01 * breakaway).speed < 0.0);
}

TEST(load_pulls_a_standing_wheel_back_once_it_beats_friction) {
  CHECK(step({}, 0.0, {.torque_nm = 0.008}).speed == 0.0);
  CHECK(step({}, 0.0, {.torque_nm = 0.010}).speed < 0.0);
}

TEST(blocked_wheel_stands_and_draws_current) {
  const WheelMotion wheel = step({.speed = 3.0}, 1.0, {.blocked = true});
  CHECK(wheel.speed == 0.0 && wheel.current_a == 1.0);
}
