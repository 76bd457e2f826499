// How the robot obeys what its sensors forbid: a bumper stops the wheels here.
#include "robot.hpp"

namespace wheelwire {

void Robot::note_reflexes(uint8_t reflexes) {
  if (reflexes == reflexes_) return;
  if (recorder_ != nullptr) recorder_->note_reflexes(reflexes);
  reflexes_ = reflexes;
  note_forbidden();
  target_ = limited(setpoint_);
  note_latches();
}

/// A wheel driven towards a bumper is released in this very step, even if the setpoint is allowed
/// but the wheels still slew from a forbidden one. Then a setpoint towards the bumper counts as
/// zero.
void Robot::actuate_within_reflexes(uint64_t now_us) {
  const bool is_held = forbids(forbidden(), target_);
  if (is_held) hold_off(now_us);
  if (drive_.goes_against_reflexes()) {
    drive_.release();
    bumped_until_us_ = now_us + config_.brake_time_us;
  }
  if (is_held || (target_.is_zero() && now_us < bumped_until_us_)) return hold_still(now_us);
  follow();
}

/// Acts like a stop while the robot slides on towards the bumper, then holds it like a setpoint of
/// zero. In open loop it stays stopped, because nothing can hold it.
void Robot::hold_still(uint64_t now_us) {
  const bool slides =
      now_us < bumped_until_us_ && !drive_.is_following() && drive_.turns_against_reflexes();
  if (slides || setpoint_.mode == ControlMode::kDuty) {
    drive_.release();  // What follows starts from zero, not from the earlier duty.
    return keep_stopped(config_.stop_mode != StopMode::kCoast, now_us);
  }
  drive_.follow(ControlMode::kVelocity, {}, config_);
  // While its command comes down to zero the loop drives it. If it moves on after that, it rolls.
  if (!drive_.commanded().is_zero()) return rolling_.reset();
  note_speed(now_us);
}

/// From now on the robot must be armed before it goes towards the bumper.
void Robot::hold_off(uint64_t now_us) {
  const auto held_by = [this](uint32_t way) {
    return forbids(static_cast<uint8_t>(forbidden() & way), target_) ? static_cast<uint8_t>(way)
                                                                     : uint8_t{0};
  };
  const auto held = static_cast<uint8_t>(held_by(reflex::kNoForward) | held_by(reflex::kNoReverse));
  if (moves_) end_motion(StopCause::kBumper, now_us);
  if ((held & ~unarmed_) != 0) disarm(held, now_us);
}

}  // namespace wheelwire
