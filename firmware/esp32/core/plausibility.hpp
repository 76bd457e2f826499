// How much duty a speed can need. This limits the output, and reveals an encoder that loses edges:
// its wheel seems slow, so the loop drives it harder than the measured speed explains.
#pragma once

#include <stdint.h>

#include "evidence.hpp"
#include "gains.hpp"

namespace wheelwire {

struct Supply {
  int32_t nominal_mv;     ///< Behind the bridge, where the feed-forward holds.
  int32_t drop_mv;        ///< Lost in the bridge.
  int32_t unmeasured_mv;  ///< Battery voltage assumed where it is not measured.
};

constexpr int32_t kOne_q12 = 4096;

/// Nominal over present supply behind the bridge, x 4096.
inline int32_t supply_ratio_q12(uint16_t battery_mv, const Supply& supply) {
  const int32_t measured_mv = battery_mv != 0 ? battery_mv : supply.unmeasured_mv;
  const int32_t behind_mv = measured_mv - supply.drop_mv;
  if (behind_mv <= 0 || supply.nominal_mv <= 0) return 4 * kOne_q12;
  return clamp(supply.nominal_mv * kOne_q12 / behind_mv, kOne_q12 / 4, 4 * kOne_q12);
}

/// The most that a load can need at constant speed: `margin_q15` beyond the feed-forward.
inline int32_t duty_for(int32_t speed_umps, int32_t margin_q15, int32_t supply_q12,
                        const ControllerGains& gains) {
  const int32_t moving_q15 = scale(gains.feedforward_q24, magnitude(speed_umps), 24);
  return scale(moving_q15 + gains.static_q15 + margin_q15, supply_q12, 12);
}

/// The output's limit at a constant setpoint.
inline int32_t duty_limit(int32_t target_umps, int32_t supply_q12, const ControllerGains& gains) {
  // More than is plausible: otherwise the limit would hide a wheel whose encoder loses edges.
  const int32_t margin_q15 = gains.margin_q15 + (gains.margin_q15 >> 2);
  const int32_t limit = duty_for(target_umps, margin_q15, supply_q12, gains);
  return limit < gains.limit_q15 ? limit : gains.limit_q15;
}

/// That limit with what a change of the setpoint needs, per control step.
inline int32_t while_accelerating(int32_t limit_q15, int32_t change_umps,
                                  const ControllerGains& gains) {
  if (change_umps == 0) return limit_q15;
  const int64_t growing = static_cast<int64_t>(gains.acceleration_q24) * magnitude(change_umps);
  const int64_t limit = limit_q15 + (growing >> 24);
  return limit < gains.limit_q15 ? static_cast<int32_t>(limit) : gains.limit_q15;
}

class PlausibilityMonitor {
 public:
  /// Call at every control step with the duty that was on the output since the last one. True once
  /// it has exceeded what the speed and its growth can need for `time_us`.
  bool update(int32_t duty_q15, int32_t measured_umps, bool ticked, int32_t supply_q12,
              uint32_t period_us, uint32_t time_us, const ControllerGains& gains) {
    const int32_t speed_umps = clamp(measured_umps, -kMaxSpeed_umps, kMaxSpeed_umps);
    const int32_t change_q4 =
        (speed_umps * 16 - slow_umps_q4_) >> (gains.memory_shift - kFilter_bits);
    slow_umps_q4_ += change_q4;
    silence_us_ = ticked ? 0 : silence_us_ + period_us;
    const int32_t excess_q15 =
        magnitude(duty_q15) - duty_for(speed_umps, gains.margin_q15, supply_q12, gains);
    if (excess_q15 > 0) {
      const bool backward = duty_q15 < 0;
      return lasts(excess_q15, backward ? -change_q4 : change_q4,
                   backward ? -speed_umps : speed_umps, backward ? -slow_umps_q4_ : slow_umps_q4_,
                   supply_q12, period_us, time_us, gains);
    }
    excess_.refute(period_us, kRefuted_us);
    return false;
  }
  /// Call it instead while no loop drives the wheel: what it did before is not forgotten.
  void rest(uint32_t period_us) {
    slow_umps_q4_ = 0;
    silence_us_ = 0;
    excess_.leak(period_us);
  }
  /// Somebody has cleared the fault, or what seemed to be one was none.
  void end_evidence() { excess_.end(); }

 private:
  // A wheel without a tick for this long is at rest, which is for FaultMonitor to judge. The time
  // does not count here: a wheel that is blocked for a moment is not a fault.
  static constexpr uint32_t kSilent_us = 180'000;

  // The low-pass filter that measures the growth of the speed has a quarter of ObstacleMemory's
  // time.
  static constexpr int32_t kFilter_bits = 2;

  // Faster than any wheel, and small enough for the sums below to stay within 32 bits.
  static constexpr int32_t kMaxSpeed_umps = 12'000'000;

  // A robot may be this much heavier than its feed-forward of acceleration says. Its speed then
  // lags behind its setpoint, too, but it grows for as long as it is driven that hard.
  static constexpr int32_t kHeavy = 8;

  // A wheel that loses this much speed has met an obstacle or reversed, and starts again. Less may
  // be the noise of an encoder that loses edges.
  static constexpr int32_t kSetback_q4 = 75'000 * 16;

  // A speed that explains the duty for this long refutes what did not. An encoder that loses its
  // edges in short gaps explains it between them alone.
  static constexpr uint32_t kRefuted_us = 100'000;

  /// Whether the excess has lasted for its time. Speeds are those in the direction of the drive.
  bool lasts(int32_t excess_q15, int32_t gain_q4, int32_t speed_umps, int32_t slow_q4,
             int32_t supply_q12, uint32_t period_us, uint32_t time_us,
             const ControllerGains& gains) {
    if (gain_q4 > 0)
      excess_q15 = saturate32(static_cast<int64_t>(excess_q15) -
                              multiply_shift(gains.acceleration_q24, gain_q4, 28));
    if (excess_q15 <= 0) {
      excess_.refute(period_us, kRefuted_us);
      return false;
    }
    if (silence_us_ >= kSilent_us) {
      begin_anew(0, time_us);
      return false;
    }
    if (!gains_speed_like_a_heavy_robot(excess_q15, speed_umps, slow_q4, supply_q12, time_us,
                                        gains)) {
      return excess_.add(period_us) >= time_us;
    }
    // The time stays just short of its end: once the speed grows no more, it is over.
    if (excess_.us() + period_us < time_us) excess_.add(period_us);
    return false;
  }
  /// Whether the recent excess is no more than it would take a heavy robot to gain speed as this
  /// one recently did: both are forgotten at the same pace.
  bool gains_speed_like_a_heavy_robot(int32_t excess_q15, int32_t speed_umps, int32_t slow_q4,
                                      int32_t supply_q12, uint32_t time_us,
                                      const ControllerGains& gains) {
    const int32_t memory_shift = gains.memory_shift - 1;
    if (excess_.us() == 0 || slow_q4 < earlier_q4_ - kSetback_q4) begin_anew(slow_q4, time_us);
    impulse_q15_ += excess_q15 - (impulse_q15_ >> memory_shift);
    earlier_q4_ += (slow_q4 - earlier_q4_) >> memory_shift;
    // Ticks are overdue: perhaps an obstacle that the filtered speed does not show yet.
    if (speed_umps * 16 < slow_q4 / 2) return true;
    // The filtered speed lags while it grows, and the measured speed falls first.
    const int32_t present_q4 = speed_umps * 16 > slow_q4 ? speed_umps * 16 : slow_q4;
    const int32_t light_q15 =
        multiply_shift(gains.acceleration_q24, (present_q4 - earlier_q4_) / 16, 24);
    return impulse_q15_ <= (static_cast<int64_t>(light_q15) * supply_q12 * kHeavy >> 12);
  }
  /// A wheel that stood, met an obstacle or reversed gets half of the time to gain speed.
  void begin_anew(int32_t slow_q4, uint32_t time_us) {
    excess_.shorten_to(time_us / 2);
    earlier_q4_ = slow_q4;
    impulse_q15_ = 0;
  }

  int32_t slow_umps_q4_ = 0;  // The speed, low-pass filtered.
  uint32_t silence_us_ = 0;
  Evidence excess_;
  // While there is excess: the speed in the direction of the drive, low-pass filtered again, and
  // the sum of the recent excess.
  int32_t earlier_q4_ = 0;
  int64_t impulse_q15_ = 0;
};

}  // namespace wheelwire
