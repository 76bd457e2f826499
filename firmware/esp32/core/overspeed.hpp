// Notices a robot that rolls much faster than it is asked to: downhill, on a slope that its motors
// do not hold, or by feedback that says too little.
#pragma once

#include "evidence.hpp"

namespace wheelwire {

class OverspeedMonitor {
 public:
  /// Call at every control step with the speed of both wheels in sum, and with what either may do
  /// at most: the limit, or a command that still falls to it. True once their mean was half as fast
  /// again for kTimeUs.
  bool update(uint32_t sum_umps, uint32_t allowed_umps, uint32_t period_us) {
    if (sum_umps > 3 * allowed_umps) return excess_.add(period_us) >= kTimeUs;
    if (sum_umps <= 2 * allowed_umps)
      excess_.refute(period_us, kObeyedUs);
    else
      excess_.leak(period_us);
    return false;
  }
  /// Call it instead while no loop drives the wheels at a velocity.
  void rest(uint32_t period_us) { excess_.leak(period_us); }
  /// Whether an update with this sum, and `allowed_umps` or more, would change nothing.
  bool is_quiet(uint32_t sum_umps, uint32_t allowed_umps) const {
    return excess_.is_none() && sum_umps <= 3 * allowed_umps;
  }
  void end_evidence() { excess_.end(); }

 private:
  static constexpr uint32_t kTimeUs = 1'000'000;
  /// Within the limit for this long it has obeyed: longer than a start from rest takes.
  static constexpr uint32_t kObeyedUs = 500'000;

  Evidence excess_;
};

}  // namespace wheelwire
