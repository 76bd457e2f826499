// What a battery's levels forbid, by docs/sensors.md and the voltage that the chip can see.
#pragma once

#include "peripherals.hpp"

namespace wheelwire::explore {

class BatteryWitness {
 public:
  /// The firmware starts with this list.
  void start(const PeripheralList& list) {
    *this = {};
    for (const Peripheral& entry : list)
      if (entry.kind == PeripheralKind::kBattery && is_guarded(entry)) levels_ = entry;
  }

  /// A control step reads this voltage.
  void reads(uint16_t millivolts, uint64_t now_us) {
    if (!is_guarded(levels_)) return;
    if (first_us_ == kNever) first_us_ = seen_us_ = now_us;
    if (millivolts != 0) {
      is_read_ = true;
      is_broken_ = false;
      seen_us_ = now_us;
      return follow(millivolts, now_us);
    }
    if (now_us - seen_us_ >= (is_read_ ? kBrokenUs : kMissingUs)) is_broken_ = true;
  }

  // Of a moment between two readings, at which the chip would see this voltage.
  /// What it forbids for certain.
  uint8_t forbids(uint16_t millivolts, uint64_t now_us) const {
    if (!is_guarded(levels_)) return 0;
    if (is_broken_ && millivolts == 0) return reflex::kStop;
    if (may_change(now_us)) return 0;
    return of(level_);
  }
  /// What it may forbid.
  uint8_t may_forbid(uint16_t millivolts, uint64_t now_us) const {
    if (!is_guarded(levels_)) return 0;
    uint8_t forbidden = of(level_);
    if (is_broken_ || millivolts == 0) forbidden |= reflex::kStop;
    if (may_change(now_us) || !is_read_) forbidden |= reflex::kStop | reflex::kLimit;
    return forbidden;
  }
  /// Nobody knows it yet, and nothing drives.
  bool is_unread(uint16_t millivolts) const { return may_be_unread() && millivolts == 0; }
  bool may_be_unread() const { return is_guarded(levels_) && !is_read_ && !is_broken_; }

 private:
  static constexpr uint64_t kNever = ~uint64_t{0};
  static constexpr uint64_t kFallUs = 2'000'000;
  static constexpr uint64_t kRiseUs = 10'000'000;
  static constexpr uint64_t kBrokenUs = 100'000;
  static constexpr uint64_t kMissingUs = 1'000'000;
  /// Two of the longest control periods.
  static constexpr uint64_t kSlackUs = 25'000;

  enum Level { kGood, kLow, kLimited, kEmpty };

  static uint8_t of(Level level) {
    return level == kEmpty ? reflex::kStop : level == kLimited ? reflex::kLimit : 0u;
  }
  Level at(double millivolts) const {
    if (millivolts < levels_.value_c) return kEmpty;
    if (millivolts < levels_.value_b) return kLimited;
    return millivolts < levels_.value_a ? kLow : kGood;
  }
  bool may_change(uint64_t now_us) const {
    return (falls_since_us_ != kNever && now_us + kSlackUs >= falls_since_us_ + kFallUs) ||
           (rises_since_us_ != kNever && now_us + kSlackUs >= rises_since_us_ + kRiseUs);
  }

  void follow(uint16_t millivolts, uint64_t now_us) {
    const Level seen = at(millivolts);
    if (!has_level_) {
      has_level_ = true;
      level_ = seen;
      return;
    }
    if (seen > level_) {
      rises_since_us_ = kNever;
      if (falls_since_us_ == kNever) falls_since_us_ = now_us;
      if (now_us - falls_since_us_ < kFallUs) return;
      return change(seen);
    }
    falls_since_us_ = kNever;
    // Above the bounds by a 32nd.
    Level wanted = at(millivolts - millivolts / 32);
    if (level_ == kEmpty && wanted != kGood) wanted = kEmpty;
    if (wanted >= level_) {
      rises_since_us_ = kNever;
      return;
    }
    if (rises_since_us_ == kNever || wanted != rises_to_) rises_since_us_ = now_us;
    rises_to_ = wanted;
    if (now_us - rises_since_us_ >= kRiseUs) change(wanted);
  }
  void change(Level level) {
    level_ = level;
    falls_since_us_ = rises_since_us_ = kNever;
  }

  Peripheral levels_{};
  uint64_t first_us_ = kNever;
  uint64_t seen_us_ = 0;  ///< When it was last other than 0 mV.
  bool is_read_ = false;
  bool is_broken_ = false;
  bool has_level_ = false;
  Level level_ = kGood;
  Level rises_to_ = kGood;
  uint64_t falls_since_us_ = kNever;
  uint64_t rises_since_us_ = kNever;
};

}  // namespace wheelwire::explore
