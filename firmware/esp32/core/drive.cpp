#include "drive.hpp"

#include "slew.hpp"

namespace wheelwire {
namespace {

/// What an encoder that fails may report is bounded here once: a correction is at most as large as
/// the setpoint, so that no sum of the two overflows, however long the robot follows.
int32_t plausible(int32_t measured_umps) {
  return clamp<int32_t>(measured_umps, -INT32_MAX / 2, INT32_MAX / 2);
}

/// As flags of `fault`.
uint32_t flags_of(WheelFault left, WheelFault right) {
  uint32_t flags = 0;
  if (left == WheelFault::kNotCounting) flags |= fault::kLeftNotCounting;
  if (left == WheelFault::kReversed) flags |= fault::kLeftReversed;
  if (right == WheelFault::kNotCounting) flags |= fault::kRightNotCounting;
  if (right == WheelFault::kReversed) flags |= fault::kRightReversed;
  if (left == WheelFault::kImplausible) flags |= fault::kLeftEncoderImplausible;
  if (right == WheelFault::kImplausible) flags |= fault::kRightEncoderImplausible;
  return flags;
}

}  // namespace

void Drive::start(const EncoderCounts& counts) {
  left_.start(counts.left);
  right_.start(counts.right);
  left_.coast();
  right_.coast();
}

uint32_t Drive::latch(const EncoderCounts& counts, const ControlConfig& config) {
  const WheelFault left =
      left_.latch(counts.left, counts.t_us, config.left_encoder_inverted, supply_q12_, config);
  const WheelFault right =
      right_.latch(counts.right, counts.t_us, config.right_encoder_inverted, supply_q12_, config);
  uint32_t flags = 0;
  if (left != WheelFault::kNone || right != WheelFault::kNone) flags = flags_of(left, right);
  const uint32_t sum_umps = static_cast<uint32_t>(magnitude(left_.velocity_umps())) +
                            static_cast<uint32_t>(magnitude(right_.velocity_umps()));
  const auto limit_umps = static_cast<uint32_t>(config.max_velocity_umps);
  if (!overspeed_.is_quiet(sum_umps, limit_umps) && is_too_fast(sum_umps, config))
    flags |= fault::kOverspeed;
  return flags;
}

/// Out of line: it is hardly ever needed.
bool Drive::is_too_fast(uint32_t sum_umps, const ControlConfig& config) {
  if (!following_ || mode_ != ControlMode::kVelocity) {
    overspeed_.rest(config.period_us);
    return false;
  }
  const int32_t commanded = greater(magnitude(command_.left), magnitude(command_.right));
  const int32_t allowed = greater(commanded, config.max_velocity_umps);
  return overspeed_.update(sum_umps, static_cast<uint32_t>(allowed), config.period_us);
}

void Drive::note_battery(uint16_t millivolts, const ControlConfig& config) {
  if (supply_q12_ != 0 && millivolts == battery_mv_) return;
  battery_mv_ = millivolts;
  supply_q12_ = supply_ratio_q12(millivolts, config.supply);
}

void Drive::note_parameters(const ControlConfig& config) {
  // Now, not at the next battery reading: a setpoint may follow within the same step.
  supply_q12_ = supply_ratio_q12(battery_mv_, config.supply);
  if (config.motors_swapped != motors_swapped_) {
    motors_swapped_ = config.motors_swapped;
    left_.exchange_motors(right_);
  }
  if (config.encoders_swapped != encoders_swapped_) {
    encoders_swapped_ = config.encoders_swapped;
    left_.exchange_encoders(right_);
  }
}

void Drive::follow(ControlMode mode, WheelPair target, const ControlConfig& config) {
  if (consume_stop_began()) return;
  if (!following_ || mode != mode_) {
    // Slewing starts from what the wheels do now, not from zero or from an old setpoint: a robot
    // that still rolls after a stop is not braked first.
    following_ = true;
    mode_ = mode;
    slewed_ = mode == ControlMode::kVelocity
                  ? WheelPair{plausible(left_.velocity_umps()), plausible(right_.velocity_umps())}
                  : WheelPair{left_.driven_q15(), right_.driven_q15()};
    // Not from a speed in the forbidden direction: the wheels would be driven at it.
    if (forbids(reflexes_, slewed_)) slewed_ = {};
    command_ = slewed_;
    direction_ = {};
  }
  if (mode == ControlMode::kVelocity) {
    follow_velocity(target, config);
  } else {
    const WheelPair before = slewed_;
    slewed_ = approach(before, target, config.duty_slew_q15);
    // `approach` keeps the ratio of the wheels' steps, so a wheel just above a lowered limit would
    // stay there for as long as the other one has far to go.
    slewed_ = {
        towards_limit(slewed_.left, before.left, config.gains.limit_q15, config.duty_slew_q15),
        towards_limit(slewed_.right, before.right, config.gains.limit_q15, config.duty_slew_q15)};
    left_.drive_duty(slewed_.left, config.left_motor_inverted);
    right_.drive_duty(slewed_.right, config.right_motor_inverted);
  }
}

void Drive::follow_velocity(WheelPair target, const ControlConfig& config) {
  const int32_t slew = config.velocity_slew_umps;
  slewed_ = approach(slewed_, target, slew);
  WheelPair wanted = config.path.follows() ? corrected(config) : slewed_;
  if (reflexes_ != 0 && forbids(reflexes_, wanted)) wanted = slewed_;
  // Slewed again, at the end: a correction may jump, for example when one wheel is released, or
  // when corrections are switched off.
  command_ = {step_towards(command_.left, wanted.left, slew),
              step_towards(command_.right, wanted.right, slew)};
  left_.drive_velocity(slewed_.left, command_.left, config.left_motor_inverted, supply_q12_,
                       config);
  right_.drive_velocity(slewed_.right, command_.right, config.right_motor_inverted, supply_q12_,
                        config);
}

/// The setpoint plus the correction of the following error, within the limit of velocity.
WheelPair Drive::corrected(const ControlConfig& config) {
  const WheelPair before = direction_;
  direction_ = {sign(slewed_.left), sign(slewed_.right)};
  const bool same = direction_.left == before.left && direction_.right == before.right &&
                    direction_.left != 0 && direction_.right != 0;
  const WheelPair behind = trim_errors({left_.behind_um(), right_.behind_um()}, slewed_, same,
                                       left_.saturated() || right_.saturated(), config.path);
  if (behind.left != left_.behind_um()) left_.trim_to(behind.left);
  if (behind.right != right_.behind_um()) right_.trim_to(behind.right);
  // A limit that was lowered while driving, or that the wheels exceed already, takes effect as fast
  // as the slew limit allows.
  const int32_t present = greater(magnitude(slewed_.left), magnitude(slewed_.right));
  const int32_t limit = config.max_velocity_umps >> ((reflexes_ & reflex::kLimit) != 0 ? 1 : 0);
  return scale_to_limit(correct_setpoint(slewed_, behind, config.path), greater(limit, present));
}

void Drive::release() {
  if (!following_) return;
  following_ = false;
  stop_began_ = true;
  left_.release();
  right_.release();
}

void Drive::keep_stopped(bool brakes) {
  if (consume_stop_began()) return;
  if (brakes) {
    left_.brake();
    right_.brake();
  } else {
    left_.coast();
    right_.coast();
  }
}

}  // namespace wheelwire
