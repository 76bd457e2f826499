// The battery's level, by its voltage.
#pragma once

#include "sensor_tables.hpp"

namespace wheelwire {

/// A level falls when the voltage was below its bound for kSagUs: a motor that starts pulls it down
/// for less. It rises when the voltage was above the bound by a 32nd for kRecoverUs, and from STOP
/// only above that of WARN: without the load that emptied it a battery's voltage rises by itself.
class BatteryGuard {
 public:
  static constexpr uint64_t kSagUs = 2'000'000;
  static constexpr uint64_t kRecoverUs = 10'000'000;

  void start(const Peripheral& entry) {
    bounds_[0] = entry.value_a;
    bounds_[1] = entry.value_b;
    bounds_[2] = entry.value_c;
  }

  BatteryLevel level() const { return level_; }
  /// True if the level is another one now.
  bool update(uint16_t millivolts, uint64_t now_us) {
    const BatteryLevel wanted = wanted_by(millivolts);
    if (level_ == BatteryLevel::kUnknown) {
      // The first one decides at once: an empty battery does not drive for the first two seconds.
      level_ = wanted;
      return true;
    }
    if (wanted == level_) {
      pending_ = level_;
      return false;
    }
    if (wanted != pending_) {
      // A fall that goes further is the same fall.
      if (!(is_lower(pending_, level_) && is_lower(wanted, level_))) since_us_ = now_us;
      pending_ = wanted;
    }
    const uint64_t needed_us = is_lower(wanted, level_) ? kSagUs : kRecoverUs;
    if (now_us - since_us_ < needed_us) return false;
    level_ = wanted;
    return true;
  }

 private:
  static constexpr bool is_lower(BatteryLevel a, BatteryLevel b) { return a > b; }

  BatteryLevel wanted_by(uint16_t millivolts) const {
    BatteryLevel wanted = below(millivolts);
    if (level_ == BatteryLevel::kUnknown || !is_lower(level_, wanted)) return wanted;
    wanted = below(static_cast<uint16_t>(millivolts - millivolts / 32));
    if (level_ == BatteryLevel::kStop && wanted != BatteryLevel::kOk) return level_;
    return is_lower(level_, wanted) ? wanted : level_;
  }
  BatteryLevel below(uint16_t millivolts) const {
    if (millivolts < bounds_[2]) return BatteryLevel::kStop;
    if (millivolts < bounds_[1]) return BatteryLevel::kLimit;
    if (millivolts < bounds_[0]) return BatteryLevel::kWarn;
    return BatteryLevel::kOk;
  }

  uint16_t bounds_[3]{};  // WARN, LIMIT, STOP
  BatteryLevel level_ = BatteryLevel::kUnknown;
  BatteryLevel pending_ = BatteryLevel::kUnknown;
  uint64_t since_us_ = 0;
};

}  // namespace wheelwire
