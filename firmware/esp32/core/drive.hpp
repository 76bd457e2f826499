// Both wheels together: setpoints, slew limits that preserve the path, and stopping.
#pragma once

#include "overspeed.hpp"
#include "reflex.hpp"
#include "wheel.hpp"

namespace wheelwire {

enum class ControlMode : uint8_t { kVelocity, kDuty };

class Drive {
 public:
  Drive(MotorPort& left, MotorPort& right) : left_(left), right_(right) {}

  /// All counts are by the wheels.
  void start(const EncoderCounts& counts);
  /// Processes the readings of both encoders. Returns the faults that they reveal, as flags.
  uint32_t latch(const EncoderCounts& counts, const ControlConfig& config);

  /// Present battery voltage; 0: not measured.
  void note_battery(uint16_t millivolts, const ControlConfig& config);

  /// What the sensors forbid from the next control step on, as flags of `reflex`.
  void note_reflexes(uint8_t reflexes) { reflexes_ = reflexes; }
  /// One control step towards the target, in um/s or q15 by the mode. The target is one that the
  /// reflexes allow.
  void follow(ControlMode mode, WheelPair target, const ControlConfig& config);
  bool is_following() const { return following_; }
  /// Whether it still slews in a direction that the reflexes do not allow. Of a velocity the
  /// command counts, too: the correction of the following error makes it another one.
  bool goes_against_reflexes() const {
    return following_ && (forbids(reflexes_, slewed_) ||
                          (mode_ == ControlMode::kVelocity && forbids(reflexes_, command_)));
  }
  /// Whether a wheel turns, driven or not, in a direction that the reflexes do not allow.
  bool turns_against_reflexes() const {
    return forbids(reflexes_, {left_.velocity_umps(), right_.velocity_umps()});
  }
  /// Somebody has cleared a fault: what the wheels did before does not count any more.
  void end_evidence() {
    left_.end_evidence();
    right_.end_evidence();
    overspeed_.end_evidence();
  }
  /// Removes the drive at once. The outputs then stay off for at least a whole control period, so
  /// that a bridge's inputs never switch while current flows. What is shorted stays so.
  void release();
  /// One control step without drive.
  void keep_stopped(bool brakes);

  /// Call when the parameters have changed.
  void note_parameters(const ControlConfig& config);

  /// What the wheels are driven at in this step, um/s; 0 unless they follow a velocity.
  WheelPair commanded() const {
    return following_ && mode_ == ControlMode::kVelocity ? command_ : WheelPair{};
  }
  const Wheel& left() const { return left_; }
  const Wheel& right() const { return right_; }
  /// Speed of the faster wheel, at least 0.
  int32_t speed_umps() const {
    return greater(magnitude(left_.velocity_umps()), magnitude(right_.velocity_umps()));
  }
  /// Both wheels, as far as their encoders show.
  bool is_still() const { return left_.is_still() && right_.is_still(); }

 private:
  void follow_velocity(WheelPair target, const ControlConfig& config);
  WheelPair corrected(const ControlConfig& config);
  /// True in the first control step after a stop began. The stop may have come a moment before this
  /// step, and the outputs have to stay off for a whole period.
  bool consume_stop_began() {
    const bool spent = stop_began_;
    stop_began_ = false;
    return spent;
  }
  bool is_too_fast(uint32_t sum_umps, const ControlConfig& config);

  Wheel left_;
  Wheel right_;
  OverspeedMonitor overspeed_;
  bool motors_swapped_ = false;
  bool encoders_swapped_ = false;
  ControlMode mode_ = ControlMode::kVelocity;
  uint8_t reflexes_ = 0;
  bool following_ = false;  // False: the next setpoint starts from the wheels' present speed.
  WheelPair slewed_{};
  WheelPair command_{};    // The setpoint with the correction of the following error.
  WheelPair direction_{};  // Signs of the setpoint in the last step.
  uint16_t battery_mv_ = 0;
  int32_t supply_q12_ = 0;   // 0: not computed yet
  bool stop_began_ = false;  // Since the last control step.
};

}  // namespace wheelwire
