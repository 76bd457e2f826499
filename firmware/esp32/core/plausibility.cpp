#include "plausibility.hpp"

namespace wheelwire {
namespace {

// A wheel without a tick for this long is at rest, which is for FaultMonitor to judge. The time
// does not count here: a wheel that is blocked for a moment is not a fault.
constexpr uint32_t kStandstill_us = 180'000;

// Time constant of the low-pass filter from which the speed's growth is taken.
constexpr uint32_t kFilter_us = 64'000;

// Faster than any wheel, and small enough for the sums below to stay within 32 bits.
constexpr int32_t kMaxSpeed_umps = 100'000'000;

constexpr int32_t kOne_q12 = 4096;

}  // namespace

int32_t supply_ratio_q12(uint16_t battery_mv, const Supply& supply) {
  const int32_t measured_mv = battery_mv != 0 ? battery_mv : supply.unmeasured_mv;
  const int32_t behind_mv = measured_mv - supply.drop_mv;
  if (behind_mv <= 0 || supply.nominal_mv <= 0) return 4 * kOne_q12;
  return clamp(supply.nominal_mv * kOne_q12 / behind_mv, kOne_q12 / 4, 4 * kOne_q12);
}

int32_t duty_for(int32_t speed_umps, int32_t margin_q15, int32_t supply_q12,
                 const ControllerGains& gains) {
  const int32_t moving_q15 = scale(gains.feedforward_q24, magnitude(speed_umps), 24);
  return scale(moving_q15 + gains.static_q15 + margin_q15, supply_q12, 12);
}

int32_t duty_limit(int32_t target_umps, int32_t change_umps, int32_t supply_q12,
                   const ControllerGains& gains) {
  const int32_t accelerating_q15 = scale(gains.acceleration_q24, magnitude(change_umps), 24);
  // More than is plausible: else the limit would hide a wheel whose encoder loses edges.
  const int32_t margin_q15 = gains.margin_q15 + gains.margin_q15 / 4;
  const int64_t limit = duty_for(target_umps, margin_q15, supply_q12, gains) + accelerating_q15;
  return limit < gains.limit_q15 ? static_cast<int32_t>(limit) : gains.limit_q15;
}

void PlausibilityMonitor::reset() {
  slow_umps_q4_ = 0;
  silence_us_ = 0;
  excess_us_ = 0;
}

bool PlausibilityMonitor::update(int32_t duty_q15, int32_t measured_umps, bool ticked,
                                 int32_t supply_q12, uint32_t period_us, uint32_t time_us,
                                 const ControllerGains& gains) {
  const int32_t speed_umps = clamp<int32_t>(magnitude(measured_umps), 0, kMaxSpeed_umps);
  const uint32_t part_q16 = (period_us << 16) / kFilter_us;
  const int32_t growth_q4 =
      scale(speed_umps * 16 - slow_umps_q4_, static_cast<int32_t>(part_q16), 16);
  slow_umps_q4_ += growth_q4;
  silence_us_ = ticked ? 0 : silence_us_ + period_us;
  int32_t needed_q15 = duty_for(speed_umps, gains.margin_q15, supply_q12, gains);
  if (growth_q4 > 0) {
    const int64_t growing_q15 = multiply_shift(gains.acceleration_q24, growth_q4, 28);
    needed_q15 = saturate32(needed_q15 + growing_q15);
  }
  if (magnitude(duty_q15) <= needed_q15) {
    excess_us_ -= excess_us_ < period_us ? excess_us_ : period_us;
  } else if (silence_us_ < kStandstill_us) {
    excess_us_ += period_us;
  }
  return excess_us_ >= time_us;
}

}  // namespace wheelwire
