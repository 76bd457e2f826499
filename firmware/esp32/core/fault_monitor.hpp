// Detects a wheel whose feedback is missing (dead encoder, stall) or inverted (motor or encoder
// wired the wrong way round).
#pragma once

#include "evidence.hpp"
#include "fixed.hpp"

namespace wheelwire {

struct FaultThresholds {
  int32_t stall_duty_q15;
  uint32_t stall_time_us;
  int32_t reversal_duty_q15;
  int32_t reversal_umps;
};

enum class WheelFault : uint8_t { kNone, kNotCounting, kReversed, kImplausible };

/// What was on a wheel's output since the last control step, and why.
struct WheelOutput {
  /// Of an output that no loop saturates.
  static constexpr int32_t kNoLimit = INT32_MAX;

  int32_t duty_q15;
  int32_t limit_q15;  ///< The most that the loop could have put there at a constant setpoint.
  int32_t direction;  ///< Sign of the setpoint; 0: zero, or none.
};

/// The thresholds of duty are upper ones: a loop at its limit cannot drive the wheel any harder, so
/// there the wheel has to obey as well.
class FaultMonitor {
 public:
  /// Call at every control step.
  WheelFault update(const WheelOutput& output, int32_t ticks, int32_t measured_umps,
                    uint32_t period_us, const FaultThresholds& thresholds) {
    const int32_t most_q15 = near(output.limit_q15);
    const int32_t least_q15 =
        lower(most_q15, lower(thresholds.stall_duty_q15, thresholds.reversal_duty_q15));
    if (still_.is_none() && opposed_.is_none() && magnitude(output.duty_q15) < least_q15) {
      // Driven gently, as it mostly is.
      anchor_ticks_ = ticks;
      against_ = false;
      return WheelFault::kNone;
    }
    return judge(output, most_q15, ticks, measured_umps, period_us, thresholds);
  }
  /// Somebody has cleared the fault, or what seemed to be one was none.
  void end_evidence() {
    still_.end();
    opposed_.end();
    against_ = false;
  }

 private:
  // An encoder that rests on an edge may toggle by one tick: that is not a turning wheel.
  static constexpr int32_t kRestingTicks = 1;

  /// Just below the limit: a setpoint that changes moves the limit, and the duty follows it late.
  static int32_t near(int32_t limit_q15) { return limit_q15 - (limit_q15 >> 4); }

  /// At a limit below stall_duty a heavy robot takes longer to start, so the time passes slower.
  static uint32_t slowed(uint32_t us) { return us * 9 / 16; }

  static int32_t lower(int32_t a, int32_t b) { return a < b ? a : b; }

  // Out of line: what `update` does in most steps takes no stack then.
  [[gnu::noinline]] WheelFault judge(const WheelOutput& output, int32_t most_q15, int32_t ticks,
                                     int32_t measured_umps, uint32_t period_us,
                                     const FaultThresholds& thresholds) {
    if (not_counting(output.duty_q15, most_q15, ticks, period_us, thresholds))
      return WheelFault::kNotCounting;
    if (reversed(output, most_q15, measured_umps, period_us, thresholds))
      return WheelFault::kReversed;
    return WheelFault::kNone;
  }
  bool not_counting(int32_t duty_q15, int32_t most_q15, int32_t ticks, uint32_t period_us,
                    const FaultThresholds& thresholds) {
    const int32_t duty = magnitude(duty_q15);
    const bool hard = duty >= thresholds.stall_duty_q15;
    const bool driven = hard || duty >= most_q15;
    if (magnitude(wrapped_difference(ticks, anchor_ticks_)) > kRestingTicks) {
      anchor_ticks_ = ticks;
      still_.end();
      return false;
    }
    const uint32_t pace_us = hard ? period_us : slowed(period_us);
    if (driven) return still_.add(pace_us) >= thresholds.stall_time_us;
    // Also where a setpoint that varies takes the duty off the limit for moments.
    still_.leak(pace_us);
    return false;
  }
  /// A decelerating wheel is driven against its motion, too, but its speed falls. With inverted
  /// feedback its speed grows, or stays constant at a limit at which the wheel turns slowly. A loop
  /// that brakes the wheel downhill drives against its setpoint as well.
  bool reversed(const WheelOutput& output, int32_t most_q15, int32_t measured_umps,
                uint32_t period_us, const FaultThresholds& thresholds) {
    const bool opposed = measured_umps != 0 && (output.duty_q15 ^ measured_umps) < 0;
    if (!opposed || output.duty_q15 == 0 || output.duty_q15 * output.direction < 0) {
      against_ = false;
      // Counter-evidence is a wheel that turns as it is driven: not one that stands or is stopped.
      const bool obeys = !opposed && output.duty_q15 != 0 && measured_umps != 0;
      if (obeys)
        opposed_.end();
      else
        opposed_.leak(period_us);
      return false;
    }
    const int32_t speed = magnitude(measured_umps);
    const int32_t duty_q15 = magnitude(output.duty_q15);
    const bool hard = duty_q15 >= lower(thresholds.reversal_duty_q15, most_q15);
    if (!hard || !against_) {
      lowest_umps_ = speed;
    } else if (speed < lowest_umps_ - lowest_umps_ / 16) {
      lowest_umps_ = speed;
      opposed_.end();
    }
    against_ = hard;
    if (duty_q15 >= most_q15)
      opposed_.add(period_us);
    else
      opposed_.leak(period_us);
    return opposed_.us() >= thresholds.stall_time_us ||
           speed - lowest_umps_ >= thresholds.reversal_umps;
  }

  int32_t anchor_ticks_ = 0;
  Evidence still_;           // Driven hard without counting from anchor_ticks_.
  bool against_ = false;     // Driven hard against the measured motion,
  int32_t lowest_umps_ = 0;  // the lowest speed since then,
  Evidence opposed_;         // and for how long it has not fallen though driven at the limit.
};

}  // namespace wheelwire
