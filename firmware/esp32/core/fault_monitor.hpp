// Detects a wheel whose feedback is missing (dead encoder, stall) or inverted (motor or encoder
// wired the wrong way round).
#pragma once

#include "evidence.hpp"

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
                    uint32_t period_us, const FaultThresholds& thresholds);
  /// Somebody has cleared the fault, or what seemed to be one was none.
  void end_evidence() {
    still_.end();
    opposed_.end();
    against_ = false;
  }

 private:
  // Out of line: what `update` does in most steps takes no stack then.
  [[gnu::noinline]] WheelFault judge(const WheelOutput& output, int32_t most_q15, int32_t ticks,
                                     int32_t measured_umps, uint32_t period_us,
                                     const FaultThresholds&);
  bool not_counting(int32_t duty_q15, int32_t most_q15, int32_t ticks, uint32_t period_us,
                    const FaultThresholds&);
  bool reversed(const WheelOutput& output, int32_t most_q15, int32_t measured_umps,
                uint32_t period_us, const FaultThresholds&);

  int32_t anchor_ticks_ = 0;
  Evidence still_;           // Driven hard without counting from anchor_ticks_.
  bool against_ = false;     // Driven hard against the measured motion,
  int32_t lowest_umps_ = 0;  // the lowest speed since then,
  Evidence opposed_;         // and for how long it has not fallen though driven at the limit.
};

}  // namespace wheelwire
