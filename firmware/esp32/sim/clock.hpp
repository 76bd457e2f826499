// Simulated time, and the device's clock, which starts at a reset and drifts against it.
#pragma once

#include <cmath>
#include <cstdint>

namespace wheelwire::sim {

/// Simulated time [ns].
using Nanoseconds = int64_t;

class DeviceClock {
 public:
  double ppm() const { return ppm_; }

  /// From `now` on the clock runs fast by this many parts per million. It does not jump.
  void set_ppm(double ppm, Nanoseconds now) {
    anchor_us_ = exact_us(now);
    anchor_ = now;
    ppm_ = ppm;
  }

  /// Starts from 0.
  void reset(Nanoseconds now) {
    anchor_us_ = 0.0;
    anchor_ = now;
  }

  uint64_t microseconds(Nanoseconds now) const {
    return static_cast<uint64_t>(std::floor(exact_us(now) + kRounding));
  }

  /// The first simulated time at which the clock shows `device_us`.
  Nanoseconds when(uint64_t device_us) const {
    const double wait_us = (static_cast<double>(device_us) - anchor_us_) / rate();
    return anchor_ + static_cast<Nanoseconds>(std::ceil(wait_us * 1e3 - kRounding));
  }

 private:
  // Far below a nanosecond, far above the rounding of a double that holds years of microseconds.
  static constexpr double kRounding = 1e-3;

  double rate() const { return 1.0 + ppm_ * 1e-6; }
  double exact_us(Nanoseconds now) const {
    return anchor_us_ + static_cast<double>(now - anchor_) * 1e-3 * rate();
  }

  double ppm_ = 0.0;
  double anchor_us_ = 0.0;
  Nanoseconds anchor_ = 0;
};

}  // namespace wheelwire::sim
