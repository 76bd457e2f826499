#include "fault_monitor.hpp"

#include "fixed.hpp"

namespace wheelwire {
namespace {

// An encoder that rests on an edge may toggle by one tick: that is not a turning wheel.
constexpr int32_t kRestingTicks = 1;

}  // namespace

void FaultMonitor::reset() {
  driven_hard_ = false;
  against_ = false;
}

WheelFault FaultMonitor::update(int32_t duty_q15, int32_t ticks, int32_t measured_umps,
                                uint64_t now_us, const FaultThresholds& thresholds) {
  if (not_counting(duty_q15, ticks, now_us, thresholds)) return WheelFault::kNotCounting;
  if (reversed(duty_q15, measured_umps, thresholds)) return WheelFault::kReversed;
  return WheelFault::kNone;
}

bool FaultMonitor::not_counting(int32_t duty_q15, int32_t ticks, uint64_t now_us,
                                const FaultThresholds& thresholds) {
  const auto travel =
      static_cast<int32_t>(static_cast<uint32_t>(ticks) - static_cast<uint32_t>(anchor_ticks_));
  const bool hard = magnitude(duty_q15) >= thresholds.stall_duty_q15;
  const bool moved = travel > kRestingTicks || travel < -kRestingTicks;
  if (!hard || !driven_hard_ || moved) {
    driven_hard_ = hard;
    hard_since_us_ = now_us;
    anchor_ticks_ = ticks;
    return false;
  }
  return now_us - hard_since_us_ >= thresholds.stall_time_us;
}

/// A decelerating wheel is driven against its motion, too, but its speed falls. With inverted
/// feedback it grows.
bool FaultMonitor::reversed(int32_t duty_q15, int32_t measured_umps,
                            const FaultThresholds& thresholds) {
  const int32_t speed = magnitude(measured_umps);
  if (magnitude(duty_q15) < thresholds.reversal_duty_q15 ||
      sign(duty_q15) * sign(measured_umps) >= 0) {
    against_ = false;
    return false;
  }
  lowest_umps_ = against_ && lowest_umps_ < speed ? lowest_umps_ : speed;
  against_ = true;
  return speed - lowest_umps_ >= thresholds.reversal_umps;
}

}  // namespace wheelwire
