#include "plant.hpp"

#include <algorithm>
#include <cmath>

namespace wheelwire::sim {

namespace {

constexpr double kGravity = 9.80665;  // [m/s^2]

/// Seen at each wheel [kg m^2]. Each carries half of the robot; they are not coupled, as in a robot
/// whose radius of gyration is half its wheel separation.
double wheel_inertia(const PlantModel& model) {
  const double radius = model.wheel_radius_m;
  return model.mass_kg / 2.0 * radius * radius + model.rotor_inertia_kgm2;
}

}  // namespace

bool is_physical(const PlantModel& model) {
  const MotorConstants motor = derive(model.motor, model.bridge, model.friction);
  if (!(motor.winding_ohm > 0.0 && motor.emf_vs > 0.0)) return false;
  double least_scale = 1.0;
  for (const WheelModel& wheel : model.wheels) {
    least_scale = std::min(least_scale, wheel.motor_scale);
  }
  const double damping = motor.torque_nm_per_a * motor.emf_vs / least_scale / motor.winding_ohm +
                         model.friction.viscous_nms;
  return damping / wheel_inertia(model) * kMaxPhysicsStep < 0.5;
}

void Plant::configure(const PlantModel& model) {
  model_ = model;
  motor_ = derive(model.motor, model.bridge, model.friction);
  inertia_ = wheel_inertia(model);
  slope_torque_ = model.mass_kg / 2.0 * kGravity * std::sin(model.slope_rad) * model.wheel_radius_m;
}

void Plant::step(double dt, const std::array<BridgePins, 2>& pins) {
  const double slope = slope_torque_ == 0.0 ? 0.0 : slope_torque_ * std::cos(pose_.heading_rad);
  for (const Side side : kSides) {
    const WheelModel& model = model_.wheels[side];
    const double polarity = model.motor_reversed ? -1.0 : 1.0;
    const double emf = motor_.emf_vs / model.motor_scale * wheels_[side].speed;
    const double current =
        model_.bridge.current(pins[side], polarity * emf, motor_.winding_ohm) * polarity;
    wheels_[side] =
        step_wheel(wheels_[side], dt, inertia_, current, motor_.torque_nm_per_a, model_.friction,
                   {.torque_nm = model.load_nm + slope, .blocked = model.blocked});
    turned_[side] = wheels_[side].speed * dt;
  }
  step_pose();
}

/// Exact arc of the two rolled lengths, the chord taken along the mean heading.
void Plant::step_pose() {
  const double left = turned_[kLeft] * model_.wheel_radius_m;
  const double right = turned_[kRight] * model_.wheel_radius_m;
  if (left == 0.0 && right == 0.0) return;
  const double length = (left + right) / 2.0;
  const double half_turn = (right - left) / model_.wheel_separation_m / 2.0;
  // sin(x)/x is 1 to a part in 1e13 below 1e-6.
  const double chord =
      std::abs(half_turn) < 1e-6 ? length : length * std::sin(half_turn) / half_turn;
  pose_.x_m += chord * std::cos(pose_.heading_rad + half_turn);
  pose_.y_m += chord * std::sin(pose_.heading_rad + half_turn);
  pose_.heading_rad += 2.0 * half_turn;
  distance_m_ += std::abs(length);
}

double Plant::kinetic_energy_j() const {
  const double left = wheels_[kLeft].speed;
  const double right = wheels_[kRight].speed;
  return inertia_ / 2.0 * (left * left + right * right);
}

}  // namespace wheelwire::sim
