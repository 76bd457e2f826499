// The robot's physics: two driven wheels on a plane. SI units; no clock, no firmware.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
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

  /// Hands move the robot at this speed, whatever its wheels and motors do, and let go once it
  /// stands again. On the floor its wheels roll with it, except a blocked one.
  Push push;
  /// Hands tilt the robot to this, and hold it so. Its wheels do not notice.
  Tilt held;
  /// What the motors have drawn from a battery that can be emptied; 0: it is full.
  double used_ah = 0.0;

  const PlantModel& model() const { return model_; }

  /// Changes the model while the robot moves: wheel speeds and pose stay. It must be physical.
  void configure(const PlantModel& model) {
    model_ = model;
    bridge_ = model.bridge;
    bridge_.supply_v = open_v();
    for (const Side side : kSides) {
      constants_[side] = constants_of(model, side);
      if (model.wheels[side].backlash_rad == 0.0) gears_[side].in_play = false;
      slip_[side] = 0.0;
    }
  }

  /// Advances by `dt` seconds, at most kMaxPhysicsStep.
  void step(double dt, const std::array<BridgeState, 2>& bridges) {
    const double uphill = model_.slope_rad == 0.0 ? 0.0 : std::cos(pose_.heading_rad);
    if (model_.supply_ohm != 0.0 || model_.battery_ah != 0.0) step_supply(dt, bridges);
    step_tilt(dt);
    forward_mps_ = yaw_rate_radps_ = 0.0;
    if (is_pushed()) return step_push(dt, bridges, uphill);
    for (const Side side : kSides) step_side(side, dt, bridge_of(side, bridges), uphill);
    if (model_.wheels_free) return;
    std::array<double, 2> travel_m{};
    for (const Side side : kSides)
      travel_m[side] = gears_[side].rolled_rad * constants_[side].radius_m * (1.0 - slip(side));
    step_pose(travel_m[kLeft], travel_m[kRight], dt);
  }

  /// A hand turns the wheel by this angle from here, forward positive, and then lets go; 0 lets go
  /// at once. A blocked wheel cannot be turned.
  void turn_by_hand(Side side, double angle_rad) { hand_rad_[side] = angle_rad; }
  /// Still to be turned by hand.
  double hand_rad(Side side) const { return hand_rad_[side]; }
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

  /// Current that these bridges draw from the supply.
  double drawn_a(const std::array<BridgeState, 2>& bridges) const {
    double drawn_a = 0.0;
    for (const Side side : kSides) {
      const BridgeState& bridge = bridge_of(side, bridges);
      // The supply feeds the motor in the PWM's on time; in the rest its current circulates.
      const double net = bridge.signed_duty();
      const double share = bridge_.chopped ? 1.0 : std::abs(net);
      const bool reversed = model_.wheels[side].motor_reversed == (net > 0.0);
      const double current_a = wheels_[side].current_a * (reversed ? -1.0 : 1.0);
      if (bridge.drives()) drawn_a += share * std::max(0.0, current_a);
    }
    return drawn_a;
  }

  double sag_v() const { return model_.bridge.supply_v - bridge_.supply_v; }

  double kinetic_energy_j() const {
    double energy = 0.0;
    for (const Side side : kSides) {
      const double inertia =
          gears_[side].in_play ? model_.rotor_inertia_kgm2 : constants_[side].inertia;
      energy += inertia / 2.0 * wheels_[side].speed * wheels_[side].speed;
    }
    return energy;
  }

  bool stands_still() const { return wheels_[kLeft].speed == 0.0 && wheels_[kRight].speed == 0.0; }

 private:
  static constexpr double kMostSlip = 0.9;

  static double approached(double value, double target, double most) {
    return value + std::clamp(target - value, -most, most);
  }

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

  /// Each wheel carries half of the robot; they are not coupled, as in a robot whose radius of
  /// gyration is half its wheel separation.
  static Plant::WheelConstants constants_of(const PlantModel& model, Side side) {
    const WheelModel& wheel = model.wheels[side];
    const double radius = model.wheel_radius_m * wheel.radius_scale;
    const double share_kg = model.wheels_free ? 0.0 : model.mass_kg / 2.0;
    const double body_inertia = share_kg * radius * radius;
    MotorConstants motor = derive(model.motor, model.bridge, model.friction);
    motor.winding_ohm *= wheel.winding_scale;
    motor.torque_nm_per_a *= wheel.torque_scale;
    motor.emf_vs /= wheel.motor_scale;
    return {
        .radius_m = radius,
        .body_inertia = body_inertia,
        .inertia = body_inertia + model.rotor_inertia_kgm2,
        .slope_torque = share_kg * kGravity * std::sin(model.slope_rad) * radius,
        .slip_per_nm = model.wheels_free ? 0.0 : model.slip / (share_kg * kGravity * radius),
        .motor = motor,
        .friction = {.coulomb_nm = model.friction.coulomb_nm * wheel.coulomb_scale,
                     .static_nm = model.friction.static_nm * wheel.static_scale,
                     .viscous_nms = model.friction.viscous_nms * wheel.viscous_scale},
    };
  }

  void step_tilt(double dt) {
    tilt_.roll_rad = approached(tilt_.roll_rad, held.roll_rad, kTiltSpeed * dt);
    tilt_.pitch_rad = approached(tilt_.pitch_rad, held.pitch_rad, kTiltSpeed * dt);
  }

  /// Hands are stronger than motors.
  void step_push(double dt, const std::array<BridgeState, 2>& bridges, double uphill) {
    pushed_.forward_mps =
        approached(pushed_.forward_mps, push.forward_mps, kPushGrowth.forward_mps * dt);
    pushed_.turn_radps =
        approached(pushed_.turn_radps, push.turn_radps, kPushGrowth.turn_radps * dt);
    const double apart_mps = pushed_.turn_radps * model_.wheel_separation_m / 2.0;
    const std::array<double, 2> speed_mps{pushed_.forward_mps - apart_mps,
                                          pushed_.forward_mps + apart_mps};
    for (const Side side : kSides) {
      if (model_.wheels_free || model_.wheels[side].blocked)
        step_side(side, dt, bridge_of(side, bridges), uphill);
      else
        roll_along(side, speed_mps[side] / constants_[side].radius_m, dt, bridge_of(side, bridges));
    }
    step_pose(speed_mps[kLeft] * dt, speed_mps[kRight] * dt, dt);
  }

  /// Wheel and motor turn alike: the floor does not cross the gearbox's play.
  void roll_along(Side side, double speed, double dt, const BridgeState& bridge) {
    wheels_[side] = {.speed = speed, .current_a = current_through(side, bridge)};
    Gear& gear = gears_[side];
    gear.turned_rad = gear.rolled_rad = speed * dt;
    gear.wheel_rad += gear.rolled_rad;
    gear.in_play = false;
    slip_[side] = 0.0;
  }

  double current_through(Side side, const BridgeState& bridge) const {
    const WheelModel& model = model_.wheels[side];
    if (model.motor_open) return 0.0;
    const MotorConstants& motor = constants_[side].motor;
    const double polarity = model.motor_reversed ? -1.0 : 1.0;
    const double emf = motor.emf_vs * wheels_[side].speed;
    return bridge_.current(bridge, polarity * emf, motor.winding_ohm) * polarity;
  }

  /// The voltage moves towards what the last step's current leaves of it, by the share that is
  /// stable at any resistance: the current grows with the voltage by 1 / winding_ohm at most.
  void step_supply(double dt, const std::array<BridgeState, 2>& bridges) {
    double conductance = 0.0;
    for (const Side side : kSides) conductance += 1.0 / constants_[side].motor.winding_ohm;
    const double drawn = drawn_a(bridges);
    if (model_.battery_ah != 0.0) used_ah += drawn * dt / 3600.0;
    const double target = std::max(0.0, open_v() - model_.supply_ohm * drawn);
    bridge_.supply_v += (target - bridge_.supply_v) / (1.0 + model_.supply_ohm * conductance);
  }

  /// Of the supply, without a load.
  double open_v() const {
    const double full_v = model_.bridge.supply_v;
    if (model_.battery_ah == 0.0) return full_v;
    const double used = std::min(1.0, used_ah / model_.battery_ah);
    return std::max(0.0, full_v - model_.battery_fall_v * used);
  }

  void step_side(Side side, double dt, const BridgeState& bridge, double uphill) {
    const WheelModel& model = model_.wheels[side];
    const WheelConstants& constants = constants_[side];
    const WheelMotion before = wheels_[side];
    Gear& gear = gears_[side];
    const double current = current_through(side, bridge);
    if (hand_rad_[side] != 0.0 && !model.blocked) {
      turn_by_hand_for(side, dt, current);
    } else {
      const double load = gear.in_play ? 0.0 : model.load_nm + constants.slope_torque * uphill;
      wheels_[side] =
          step_wheel(before, dt, gear.in_play ? model_.rotor_inertia_kgm2 : constants.inertia,
                     current, constants.motor.torque_nm_per_a, constants.friction,
                     {.torque_nm = load, .blocked = model.blocked});
      gear.turned_rad = wheels_[side].speed * dt;
      if (constants.slip_per_nm != 0.0 && !gear.in_play) {
        const double acceleration = (wheels_[side].speed - before.speed) / dt;
        step_slip(side, load + constants.body_inertia * acceleration);
      }
    }
    gear.rolled_rad = gear.turned_rad;
    if (model.backlash_rad != 0.0) engage(side);
    gear.wheel_rad += gear.rolled_rad;
  }

  /// `push_nm` is what the floor receives of the wheel's torque, forward positive.
  void step_slip(Side side, double push_nm) {
    const double lost = constants_[side].slip_per_nm * std::abs(push_nm);
    slip_[side] = std::min(std::copysign(lost, push_nm * wheels_[side].speed), kMostSlip);
    slip_[side] = std::max(slip_[side], -kMostSlip);
  }

  void turn_by_hand_for(Side side, double dt, double current_a) {
    const double left = hand_rad_[side];
    const double angle = std::copysign(std::min(std::abs(left), kHandSpeed * dt), left);
    hand_rad_[side] -= angle;
    // It lets go of a standing wheel.
    wheels_[side] = {.speed = hand_rad_[side] == 0.0 ? 0.0 : angle / dt, .current_a = current_a};
    gears_[side].turned_rad = angle;
    slip_[side] = 0.0;
  }

  /// The wheel stays where it is while the motor's side crosses the play, which it does where its
  /// direction changes. Play that opens under a moving robot is not modelled.
  void engage(Side side) {
    Gear& gear = gears_[side];
    const double half = model_.wheels[side].backlash_rad / 2.0;
    const double unlimited = gear.slack_rad + gear.turned_rad;
    gear.slack_rad = std::clamp(unlimited, -half, half);
    gear.rolled_rad = unlimited - gear.slack_rad;
    const bool was_in_play = gear.in_play;
    gear.in_play = gear.rolled_rad == 0.0 && gear.turned_rad != 0.0;
    if (was_in_play && gear.rolled_rad != 0.0) {
      // The gears meet without a bounce: the momentum of the rotor moves the wheel, too.
      wheels_[side].speed *= model_.rotor_inertia_kgm2 / constants_[side].inertia;
    }
  }

  /// Exact arc of the two rolled lengths, the chord taken along the mean heading.
  void step_pose(double left_m, double right_m, double dt) {
    if (left_m == 0.0 && right_m == 0.0) return;
    const double length = (left_m + right_m) / 2.0;
    const double half_turn = (right_m - left_m) / model_.wheel_separation_m / 2.0;
    // sin(x)/x is 1 to a part in 1e13 below 1e-6.
    const double chord =
        std::abs(half_turn) < 1e-6 ? length : length * std::sin(half_turn) / half_turn;
    pose_.x_m += chord * std::cos(pose_.heading_rad + half_turn);
    pose_.y_m += chord * std::sin(pose_.heading_rad + half_turn);
    pose_.heading_rad += 2.0 * half_turn;
    distance_m_ += std::abs(length);
    forward_mps_ = length / dt;
    yaw_rate_radps_ = 2.0 * half_turn / dt;
  }

  friend bool is_physical(const PlantModel& model);

  const BridgeState& bridge_of(Side side, const std::array<BridgeState, 2>& bridges) const {
    return bridges[model_.motors_swapped ? other(side) : side];
  }

  /// Whether hands move the robot in this step.
  bool is_pushed() const { return push != Push{} || pushed_ != Push{}; }
  PlantModel model_;
  BridgeModel bridge_;  ///< The model's, with the supply as it sags.
  std::array<WheelConstants, 2> constants_{};
  std::array<WheelMotion, 2> wheels_{};
  std::array<Gear, 2> gears_{};
  std::array<double, 2> hand_rad_{};
  std::array<double, 2> slip_{};
  Push pushed_;  ///< Their present speed.
  Tilt tilt_;
  Pose pose_;
  double distance_m_ = 0.0;
  double forward_mps_ = 0.0;
  double yaw_rate_radps_ = 0.0;
};

/// Whether the motor's constants come out positive, and slow enough for the integration step.
inline bool is_physical(const PlantModel& model) {
  return std::all_of(kSides.begin(), kSides.end(), [&](Side side) {
    const Plant::WheelConstants wheel = Plant::constants_of(model, side);
    const MotorConstants& motor = wheel.motor;
    if (!(motor.winding_ohm > 0.0 && motor.emf_vs > 0.0)) return false;
    const double damping =
        motor.torque_nm_per_a * motor.emf_vs / motor.winding_ohm + wheel.friction.viscous_nms;
    const bool plays = model.wheels[side].backlash_rad > 0.0;
    const double inertia = plays ? model.rotor_inertia_kgm2 : wheel.inertia;
    return damping * kMaxPhysicsStep < 0.5 * inertia;
  });
}

}  // namespace wheelwire::sim
