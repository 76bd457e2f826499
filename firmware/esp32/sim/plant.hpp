// The robot's physics: two driven wheels on a plane. SI units; no clock, no firmware.
#pragma once

#include <array>
#include <numbers>

#include "motor.hpp"

namespace wheelwire::sim {

constexpr double kGravity = 9.80665;  ///< [m/s^2]

enum Side : unsigned { kLeft = 0, kRight = 1 };
constexpr std::array<Side, 2> kSides = {kLeft, kRight};
constexpr Side other(Side side) { return side == kLeft ? kRight : kLeft; }

/// One wheel's deviations from the common model.
struct WheelModel {
  double motor_scale = 1.0;    ///< No-load speed, relative to the rating.
  double torque_scale = 1.0;   ///< Torque per ampere.
  double winding_scale = 1.0;  ///< The winding's resistance.
  double coulomb_scale = 1.0;
  double static_scale = 1.0;
  double viscous_scale = 1.0;
  double radius_scale = 1.0;
  bool motor_reversed = false;  ///< Wires swapped.
  bool motor_open = false;      ///< No current flows: a wire is off.
  /// Play of the gearbox. The encoder is on the motor's side of it.
  double backlash_rad = 0.0;
  double load_nm = 0.0;  ///< Load torque, against forward.
  double slip = 0.0;     ///< Fraction of the travel lost at any push: the wheel stands on ice.
  bool blocked = false;
};

struct PlantModel {
  double wheel_radius_m = 0.033;
  double wheel_separation_m = 0.20;
  double mass_kg = 0.8;
  double rotor_inertia_kgm2 = 5e-5;  ///< Of one motor with its wheel, seen at the wheel.
  double slope_rad = 0.0;            ///< The plane rises along the world's +x.
  /// Fraction of the travel lost when a wheel pushes with its share of the robot's weight; less in
  /// proportion to a smaller push.
  double slip = 0.0;
  double supply_ohm = 0.0;  ///< Of battery and leads: the supply sags under the motors' current.
  double battery_ah = 0.0;  ///< Charge of the full battery; 0: it stays full.
  double battery_fall_v = 1.6;  ///< Its voltage falls by this, evenly, until it is empty.
  bool wheels_free = false;     ///< Raised: only the wheels move.
  bool motors_swapped = false;  ///< Each bridge drives the other wheel's motor.
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

/// How fast a hand turns a wheel [rad/s]: once a second.
constexpr double kHandSpeed = 2.0 * std::numbers::pi;

/// How hands move the robot, from rest and back to it.
struct Push {
  double forward_mps = 0.0;
  double turn_radps = 0.0;  ///< Counter-clockwise positive.
  bool operator==(const Push&) const = default;
};
constexpr Push kPushGrowth{.forward_mps = 2.0, .turn_radps = 10.0};  ///< [a second]

/// How hands hold the robot, after its heading: pitch first, then roll about its own axis.
struct Tilt {
  double roll_rad = 0.0;   ///< The right side down positive.
  double pitch_rad = 0.0;  ///< The nose down positive.
};
constexpr double kTiltSpeed = 1.0;  ///< Of each angle [rad/s].

class Plant {
 public:
  explicit Plant(const PlantModel& model = {}) { configure(model); }

  const PlantModel& model() const { return model_; }
  /// Changes the model while the robot moves: wheel speeds and pose stay. It must be physical.
  void configure(const PlantModel& model);

  /// Advances by `dt` seconds, at most kMaxPhysicsStep.
  void step(double dt, const std::array<BridgeState, 2>& bridges);

  /// A hand turns the wheel by this angle from here, forward positive, and then lets go; 0 lets go
  /// at once. A blocked wheel cannot be turned.
  void turn_by_hand(Side side, double angle_rad) { hand_rad_[side] = angle_rad; }
  /// Still to be turned by hand.
  double hand_rad(Side side) const { return hand_rad_[side]; }

  /// Hands move the robot at this speed, whatever its wheels and motors do, and let go once it
  /// stands again. On the floor its wheels roll with it, except a blocked one.
  Push& push() { return push_; }
  const Push& push() const { return push_; }
  /// Hands tilt the robot to this, and hold it so. Its wheels do not notice.
  Tilt& held() { return held_; }
  const Tilt& held() const { return held_; }
  const Tilt& tilt() const { return tilt_; }  ///< As it is by now.

  const Pose& pose() const { return pose_; }
  double distance_m() const { return distance_m_; }  ///< Length of the centre's path.
  /// At the rim, relative to the robot.
  double speed_mps(Side side) const {
    return gears_[side].in_play ? 0.0 : wheels_[side].speed * constants_[side].radius_m;
  }
  double current_a(Side side) const { return wheels_[side].current_a; }
  /// Rotation by the last step, on the motor's side of the play.
  double turned_rad(Side side) const { return gears_[side].turned_rad; }
  double wheel_rad(Side side) const { return gears_[side].wheel_rad; }  ///< Since the start.
  /// Share of the travel that is lost.
  double slip(Side side) const {
    const double always = model_.wheels[side].slip;
    return slip_[side] + always - slip_[side] * always;
  }
  double forward_mps() const { return forward_mps_; }        ///< Of the centre, in the last step.
  double yaw_rate_radps() const { return yaw_rate_radps_; }  ///< In the last step.
  double supply_v() const { return bridge_.supply_v; }       ///< As it sags.
  /// What the motors have drawn from a battery that can be emptied; 0: it is full.
  double& used_ah() { return used_ah_; }
  const double& used_ah() const { return used_ah_; }
  /// Current that these bridges draw from the supply.
  double drawn_a(const std::array<BridgeState, 2>& bridges) const;
  double sag_v() const { return model_.bridge.supply_v - bridge_.supply_v; }
  double kinetic_energy_j() const;
  bool stands_still() const { return wheels_[kLeft].speed == 0.0 && wheels_[kRight].speed == 0.0; }

 private:
  /// Constants of one wheel, computed from the model.
  struct WheelConstants {
    double radius_m;
    double body_inertia;  ///< Its share of the robot, if it is on the floor [kg m^2].
    double inertia;       ///< With its motor.
    double slope_torque;  ///< When heading straight up [N m].
    double slip_per_nm;
    MotorConstants motor;
    Friction friction;
  };

  /// Between motor and wheel.
  struct Gear {
    double slack_rad =
        0.0;  ///< Of the motor's side against the wheel, from the middle of the play.
    double turned_rad = 0.0;  ///< By the motor's side, in the last step.
    double rolled_rad = 0.0;  ///< By the wheel, in the last step.
    double wheel_rad = 0.0;   ///< By the wheel, since the start.
    bool in_play = false;     ///< Motor and wheel do not touch.
  };

  static WheelConstants constants_of(const PlantModel& model, Side side);
  friend bool is_physical(const PlantModel& model);

  const BridgeState& bridge_of(Side side, const std::array<BridgeState, 2>& bridges) const {
    return bridges[model_.motors_swapped ? other(side) : side];
  }
  void step_supply(double dt, const std::array<BridgeState, 2>& bridges);
  double open_v() const;  ///< Of the supply, without a load.
  void step_side(Side side, double dt, const BridgeState& bridge, double uphill);
  void step_slip(Side side, double push_nm);
  void turn_by_hand_for(Side side, double dt, double current_a);
  void engage(Side side);
  void step_tilt(double dt);
  /// Whether hands move the robot in this step.
  bool is_pushed() const { return push_ != Push{} || pushed_ != Push{}; }
  void step_push(double dt, const std::array<BridgeState, 2>& bridges, double uphill);
  void roll_along(Side side, double speed, double dt, const BridgeState& bridge);
  double current_through(Side side, const BridgeState& bridge) const;
  void step_pose(double left_m, double right_m, double dt);

  PlantModel model_;
  BridgeModel bridge_;  ///< The model's, with the supply as it sags.
  std::array<WheelConstants, 2> constants_{};
  std::array<WheelMotion, 2> wheels_{};
  std::array<Gear, 2> gears_{};
  std::array<double, 2> hand_rad_{};
  std::array<double, 2> slip_{};
  Push push_;    ///< The speed that hands are to reach.
  Push pushed_;  ///< Their present speed.
  Tilt held_;    ///< The tilt that hands hold.
  Tilt tilt_;
  Pose pose_;
  double distance_m_ = 0.0;
  double forward_mps_ = 0.0;
  double yaw_rate_radps_ = 0.0;
  double used_ah_ = 0.0;
};

}  // namespace wheelwire::sim
