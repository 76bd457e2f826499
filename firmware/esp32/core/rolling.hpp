// Notices a robot that rolls away although nothing drives it: on a slope, or pushed.
#pragma once

#include <stdint.h>

#include "fixed.hpp"

namespace wheelwire {

class RollingMonitor {
 public:
  /// Call at every control step in which nothing drives, with the speed of the faster wheel,
  /// measured over the last `measured_us`. True once for each time that the robot rolls: that is,
  /// it moved at `threshold_umps` or more for a while without slowing down. A robot that was just
  /// stopped slows down.
  bool update(int32_t speed_umps, uint64_t now_us, int32_t threshold_umps, uint32_t measured_us) {
    if (speed_umps < threshold_umps) {
      is_fast_ = false;
      // Half the threshold, so that a speed close to it is not reported again and again.
      if (speed_umps < threshold_umps / 2) is_reported_ = false;
      return false;
    }
    if (!is_fast_) {
      is_fast_ = true;
      begin(speed_umps, now_us);
    }
    if (now_us - since_us_ < kSlowsUs + measured_us) return false;
    const bool slows_down = speed_umps < began_umps_ - began_umps_ / 8;
    begin(speed_umps, now_us);
    if (slows_down || is_reported_) return false;
    is_reported_ = true;
    return true;
  }
  /// Call when the robot drives.
  void reset() { is_fast_ = is_reported_ = false; }

 private:
  // A braked wheel loses half of its speed within a tenth of a second. The measured speed shows it
  // later, by what it is measured over.
  static constexpr uint32_t kSlowsUs = 300'000;

  void begin(int32_t speed_umps, uint64_t now_us) {
    began_umps_ = speed_umps;
    since_us_ = now_us;
  }

  bool is_fast_ = false;
  bool is_reported_ = false;
  int32_t began_umps_ = 0;
  uint64_t since_us_ = 0;
};

}  // namespace wheelwire
