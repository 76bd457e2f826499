// The battery's level, by its voltage.
#pragma once

#include "evidence.hpp"
#include "sensor_tables.hpp"

namespace wheelwire {

/// A bound has fallen once the voltage was below it for kSagUs: a starting motor pulls it down for
/// less. Stops do not end that time, because a battery's voltage rises by itself without the load.
/// Instead the time leaks away, and a voltage a 32nd above WARN for kRestUs ends it. A bound has
/// risen again once the voltage was a 32nd above it for kRecoverUs; the bound of STOP rises only
/// together with that of WARN. The lowest fallen bound gives the level.
class BatteryGuard {
 public:
  static constexpr uint32_t kSagUs = 2'000'000;
  static constexpr uint32_t kRestUs = 250'000;
  static constexpr uint64_t kRecoverUs = 10'000'000;

  void start(const Peripheral& entry) {
    bounds_[kWarn].millivolts = entry.value_a;
    bounds_[kLimit].millivolts = entry.value_b;
    bounds_[kStop].millivolts = entry.value_c;
  }
  /// Call before the first voltage if it was at STOP and is not known to be charged.
  void start_at_stop() {
    for (Bound& bound : bounds_) bound.has_fallen = true;
    level_ = BatteryLevel::kStop;
  }

  BatteryLevel level() const { return level_; }
  /// True if the level has changed.
  bool update(uint16_t millivolts, uint64_t now_us) {
    // The first one decides at once: an empty battery does not drive for the first two seconds.
    const bool is_first = level_ == BatteryLevel::kUnknown;
    const auto elapsed_us = static_cast<uint32_t>(now_us - read_us_);
    read_us_ = now_us;
    for (size_t i = 0; i < kBounds; ++i) {
      Bound& bound = bounds_[i];
      const bool was_pending = bound.is_pending;
      bound.is_pending = !is_first && is_beyond(i, millivolts);
      if (is_first) {
        bound.has_fallen = millivolts < bound.millivolts;
      } else if (bound.has_fallen) {
        if (!was_pending) bound.since_us = now_us;
        if (bound.is_pending && now_us - bound.since_us >= kRecoverUs) turn(bound);
      } else if (bound.is_pending) {
        if (bound.low.add(was_pending ? elapsed_us : 0) >= kSagUs) turn(bound);
      } else if (is_above(kWarn, millivolts)) {
        bound.low.refute(elapsed_us, kRestUs);
      } else {
        bound.low.leak(elapsed_us);
      }
    }
    const BatteryLevel before = level_;
    level_ = lowest();
    return level_ != before;
  }
  /// There is no voltage: this time does not count for the next one.
  void rest(uint64_t now_us) {
    read_us_ = now_us;
    for (Bound& bound : bounds_) bound.is_pending = false;
  }

 private:
  enum : size_t { kWarn, kLimit, kStop, kBounds };

  struct Bound {
    uint16_t millivolts = 0;
    bool has_fallen = false;
    bool is_pending = false;  // The voltage is beyond it, but not for long enough.
    Evidence low;             // That it falls,
    uint64_t since_us = 0;    // and since when it rises.
  };

  static void turn(Bound& bound) {
    bound.has_fallen = !bound.has_fallen;
    bound.is_pending = false;
    bound.low.end();
  }
  bool is_above(size_t which, uint16_t millivolts) const {
    return millivolts - millivolts / 32 >= bounds_[which].millivolts;
  }
  bool is_beyond(size_t which, uint16_t millivolts) const {
    const Bound& bound = bounds_[which];
    if (!bound.has_fallen) return millivolts < bound.millivolts;
    return is_above(which == kStop ? kWarn : which, millivolts);
  }
  BatteryLevel lowest() const {
    if (bounds_[kStop].has_fallen) return BatteryLevel::kStop;
    if (bounds_[kLimit].has_fallen) return BatteryLevel::kLimit;
    if (bounds_[kWarn].has_fallen) return BatteryLevel::kWarn;
    return BatteryLevel::kOk;
  }

  Bound bounds_[kBounds];
  BatteryLevel level_ = BatteryLevel::kUnknown;
  uint64_t read_us_ = 0;
};

}  // namespace wheelwire
