// Detects a wheel whose feedback is missing (dead encoder, stall) or inverted (motor or encoder
// wired the wrong way round).
#pragma once

#include <stdint.h>

namespace wheelwire {

struct FaultThresholds {
  int32_t stall_duty_q15;
  uint32_t stall_time_us;
  int32_t reversal_duty_q15;
  int32_t reversal_umps;

  template <typename Visitor>
  void visit(Visitor& visit) {
    visit("stall_duty_q15", stall_duty_q15);
    visit("stall_time_us", stall_time_us);
    visit("reversal_duty_q15", reversal_duty_q15);
    visit("reversal_umps", reversal_umps);
  }
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
                    uint32_t period_us, const FaultThresholds& thresholds);
  void reset();

  template <typename Visitor>
  void visit(Visitor& visit) {
    visit("anchor_ticks", anchor_ticks_);
    visit("still_us", still_us_);
    visit("against", against_);
    visit("lowest_umps", lowest_umps_);
    visit("against_us", against_us_);
  }

 private:
  bool not_counting(int32_t duty_q15, int32_t most_q15, int32_t ticks, uint32_t period_us,
                    const FaultThresholds&);
  bool reversed(const WheelOutput& output, int32_t most_q15, int32_t measured_umps,
                uint32_t period_us, const FaultThresholds&);

  int32_t anchor_ticks_ = 0;
  uint32_t still_us_ = 0;    // Driven hard without counting from anchor_ticks_.
  bool against_ = false;     // Driven hard against the measured motion,
  int32_t lowest_umps_ = 0;  // the lowest speed since then,
  uint32_t against_us_ = 0;  // and for how long it has not fallen though driven at the limit.
};

}  // namespace wheelwire
