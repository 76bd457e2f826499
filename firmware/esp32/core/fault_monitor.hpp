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
};

enum class WheelFault : uint8_t { kNone, kNotCounting, kReversed, kImplausible };

class FaultMonitor {
 public:
  /// Call at every control step with the duty that was on the output since the last one.
  WheelFault update(int32_t duty_q15, int32_t ticks, int32_t measured_umps, uint64_t now_us,
                    const FaultThresholds& thresholds);
  void reset();

 private:
  bool not_counting(int32_t duty_q15, int32_t ticks, uint64_t now_us, const FaultThresholds&);
  bool reversed(int32_t duty_q15, int32_t measured_umps, const FaultThresholds&);

  bool driven_hard_ = false;  // Since hard_since_us_ without counting from anchor_ticks_.
  uint64_t hard_since_us_ = 0;
  int32_t anchor_ticks_ = 0;
  bool against_ = false;     // Driven against the measured motion,
  int32_t lowest_umps_ = 0;  // and the lowest speed since then.
};

}  // namespace wheelwire
