// The robot's physics: two driven wheels on a plane. SI units; no clock, no firmware.
#pragma once

#include <array>

#include "motor.hpp"

namespace wheelwire::sim {

enum Side : unsigned { kLeft = 0, kRight = 1 };
constexpr std::array<Side, 2> kSides = {kLeft, kRight};

/// One wheel's deviations from the common model.
struct WheelModel {
  double motor_scale = 1.0;     ///< No-load speed, relative to the rating.
  bool motor_reversed = false;  ///< Wires swapped.
  double load_nm = 0.0;         ///< Against forward.
  bool blocked = false;
};

struct PlantModel {
  double wheel_radius_m = 0.033;
  double wheel_separation_m = 0.20;
  double mass_kg = 0.8;
  double rotor_inertia_kgm2 = 5e-5;  ///< Of one motor, seen at the wheel.
  double slope_rad = 0.0;            ///< The plane rises along the world's +x.
  MotorRating motor;
  Friction friction;
  BridgeModel bridge;
  std::array<WheelModel, 2> wheels;
};

/// Whether the motor's constants come out positive, and slow enough for the integration step.
bool is_physical(const PlantModel& model);

struct Pose {
  double x_m = 0.0;
  double y_m = 0.0;
  double heading_rad = 0.0;  ///< Not wrapped.
};

/// Longest step of Plant::step [s].
constexpr double kMaxPhysicsStep = 100e-6;

class Plant {
 public:
  explicit Plant(const PlantModel& model = {}) { configure(model); }

  const PlantModel& model() const { return model_; }
  /// Changes the model while the robot moves: wheel speeds and pose stay. It must be physical.
  void configure(const PlantModel& model);

  /// Advances by `dt` seconds, at most kMaxPhysicsStep.
  void step(double dt, const std::array<BridgePins, 2>& pins);

  const Pose& pose() const { return pose_; }
  double distance_m() const { return distance_m_; }  ///< Length of the centre's path.
  double speed_mps(Side side) const { return wheels_[side].speed * model_.wheel_radius_m; }
  double current_a(Side side) const { return wheels_[side].current_a; }
  double turned_rad(Side side) const { return turned_[side]; }  ///< By the last step.
  double kinetic_energy_j() const;
  bool stands_still() const { return wheels_[kLeft].speed == 0.0 && wheels_[kRight].speed == 0.0; }

 private:
  void step_pose();

  PlantModel model_;
  MotorConstants motor_{};
  double inertia_ = 0.0;       ///< Seen at each wheel [kg m^2].
  double slope_torque_ = 0.0;  ///< At each wheel when heading straight up [N m].
  std::array<WheelMotion, 2> wheels_{};
  std::array<double, 2> turned_{};
  Pose pose_;
  double distance_m_ = 0.0;
};

}  // namespace wheelwire::sim
