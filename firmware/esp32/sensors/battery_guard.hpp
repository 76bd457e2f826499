// The battery's level, by its voltage.
#pragma once

#include "sensor_tables.hpp"

namespace wheelwire {

/// Each bound has fallen once the voltage was below it for kSagUs: a motor that starts pulls it
/// down for less. It has risen again once the voltage was a 32nd above it for kRecoverUs; that of
/// STOP with that of WARN alone: without the load that emptied it a battery's voltage rises by
/// itself. The level is that of the lowest bound that has fallen.
class BatteryGuard {
 public:
  static constexpr uint64_t kSagUs = 2'000'000;
  static constexpr uint64_t kRecoverUs = 10'000'000;

  void start(const Peripheral& entry) {
    bounds_[kWarn].millivolts = entry.value_a;
    bounds_[kLimit].millivolts = entry.value_b;
    bounds_[kStop].millivolts = entry.value_c;
  }
  /// Before the first voltage: it was at STOP, and nobody knows that it was charged.
  void start_at_stop() {
    for (Bound& bound : bounds_) bound.has_fallen = true;
    level_ = BatteryLevel::kStop;
  }

  BatteryLevel level() const { return level_; }
  /// True if the level is another one now.
  bool update(uint16_t millivolts, uint64_t now_us) {
    // The first one decides at once: an empty battery does not drive for the first two seconds.
    const bool is_first = level_ == BatteryLevel::kUnknown;
    for (size_t i = 0; i < kBounds; ++i) {
      Bound& bound = bounds_[i];
      if (is_first) {
        bound.has_fallen = millivolts < bound.millivolts;
      } else if (!is_beyond(i, millivolts)) {
        bound.is_pending = false;
      } else if (!bound.is_pending) {
        bound.is_pending = true;
        bound.since_us = now_us;
      } else if (now_us - bound.since_us >= (bound.has_fallen ? kRecoverUs : kSagUs)) {
        bound.is_pending = false;
        bound.has_fallen = !bound.has_fallen;
      }
    }
    const BatteryLevel before = level_;
    level_ = lowest();
    return level_ != before;
  }
  /// There is no voltage: the next one begins anew to last.
  void forget_pending() {
    for (Bound& bound : bounds_) bound.is_pending = false;
  }

 private:
  enum : size_t { kWarn, kLimit, kStop, kBounds };

  struct Bound {
    uint16_t millivolts = 0;
    bool has_fallen = false;
    bool is_pending = false;  // The voltage is beyond it, since then, but not for long enough.
    uint64_t since_us = 0;
  };

  bool is_beyond(size_t which, uint16_t millivolts) const {
    const Bound& bound = bounds_[which];
    if (!bound.has_fallen) return millivolts < bound.millivolts;
    return millivolts - millivolts / 32 >= bounds_[which == kStop ? kWarn : which].millivolts;
  }
  BatteryLevel lowest() const {
    if (bounds_[kStop].has_fallen) return BatteryLevel::kStop;
    if (bounds_[kLimit].has_fallen) return BatteryLevel::kLimit;
    if (bounds_[kWarn].has_fallen) return BatteryLevel::kWarn;
    return BatteryLevel::kOk;
  }

  Bound bounds_[kBounds];
  BatteryLevel level_ = BatteryLevel::kUnknown;
};

}  // namespace wheelwire
