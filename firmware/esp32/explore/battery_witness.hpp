// What a battery's levels forbid, according to docs/sensors.md and the voltage that the chip sees.
#pragma once

#include <algorithm>
#include <array>

#include "peripherals.hpp"

namespace wheelwire::explore {

class BatteryWitness {
 public:
  /// The chip was reset. What it knew of STOP it keeps, unless the power was off.
  void resets(bool loses_memory) { forget(loses_memory ? Stopped::kNo : stopped_at_reset()); }

  /// The firmware starts with this list.
  void start(const PeripheralList& list) {
    forget(stopped_);
    for (const Peripheral& entry : list)
      if (entry.kind == PeripheralKind::kBattery && is_guarded(entry)) levels_ = entry;
    if (stopped_ == Stopped::kYes) {
      has_level_ = true;
      level_ = kEmpty;
    }
  }

  /// A control step reads this voltage.
  void reads(uint16_t millivolts, uint64_t now_us) {
    if (!is_guarded(levels_)) return;
    if (seen_us_ == kNever) seen_us_ = now_us;
    if (millivolts != 0) {
      is_read_ = true;
      is_broken_ = false;
      seen_us_ = now_us;
      follow(millivolts, now_us);
      read_us_ = now_us;
      return;
    }
    if (now_us - seen_us_ < (is_read_ ? kBrokenUs : kMissingUs)) return;
    read_us_ = now_us;  // Without a voltage no time counts.
    if (is_broken_) return;
    is_broken_ = true;
    is_below_ = {};
    above_us_ = kNone;
  }

  // For a moment between two readings, when the chip would see this voltage.
  /// What it surely forbids.
  uint8_t forbids(uint16_t millivolts, uint64_t now_us) const {
    if (!is_guarded(levels_)) return 0;
    if (is_broken_ && millivolts == 0) return reflex::kStop;
    if (!is_read_ || is_unsure() || is_about_to_change(now_us)) return 0;
    return of(level_);
  }
  /// What it may forbid.
  uint8_t may_forbid(uint16_t millivolts, uint64_t now_us) const {
    if (!is_guarded(levels_)) return 0;
    uint8_t forbidden = of(level_);
    if (is_broken_ || millivolts == 0 || is_unsure()) forbidden |= reflex::kStop;
    if (is_about_to_change(now_us) || !is_read_) forbidden |= reflex::kStop | reflex::kLimit;
    return forbidden;
  }
  /// The level is still unknown, and nothing drives.
  bool is_unread(uint16_t millivolts) const { return may_be_unread() && millivolts == 0; }
  bool may_be_unread() const { return is_guarded(levels_) && !is_read_ && !is_broken_; }

 private:
  static constexpr uint64_t kNever = ~uint64_t{0};
  static constexpr double kFallUs = 2e6;
  /// After this long at a 32nd above WARN, it has not fallen.
  static constexpr double kRestedUs = 250e3;
  static constexpr uint64_t kRiseUs = 10'000'000;
  static constexpr uint64_t kBrokenUs = 100'000;
  static constexpr uint64_t kMissingUs = 1'000'000;
  /// Two of the longest control periods.
  static constexpr uint64_t kSlackUs = 25'000;

  enum Level : size_t { kGood, kLow, kLimited, kEmpty, kLevels };
  /// Since when the voltage has been beyond the bound of each level.
  using Since = std::array<uint64_t, kLevels>;
  static constexpr Since kNone = {kNever, kNever, kNever, kNever};
  using Flags = std::array<bool, kLevels>;

  /// Whether it was at STOP when the chip was reset.
  enum class Stopped { kNo, kPerhaps, kYes };

  /// All but what it knows of STOP.
  void forget(Stopped stopped) {
    *this = {};
    stopped_ = stopped;
  }

  static uint8_t of(Level level) {
    return level == kEmpty ? reflex::kStop : level == kLimited ? reflex::kLimit : 0u;
  }
  /// The step in which it was reset may have read a voltage that was not recorded.
  Stopped stopped_at_reset() const {
    if (!is_guarded(levels_) || (!is_read_ && stopped_ == Stopped::kYes)) return stopped_;
    if (!has_level_ || is_unsure() || is_about_to_change(read_us_)) return Stopped::kPerhaps;
    return level_ == kEmpty ? Stopped::kYes : Stopped::kNo;
  }
  bool is_unsure() const { return stopped_ == Stopped::kPerhaps; }
  uint16_t bound_of(size_t level) const {
    return level == kEmpty     ? levels_.value_c
           : level == kLimited ? levels_.value_b
                               : levels_.value_a;
  }
  /// The level at that time, if the voltage does not change.
  Level level_after(uint64_t now_us) const {
    if (!has_level_) return level_;
    const auto lasted = [now_us](uint64_t since_us, uint64_t needed_us) {
      return since_us != kNever && now_us >= since_us + needed_us;
    };
    const auto since_us = static_cast<double>(now_us - read_us_);
    for (const Level lower : {kEmpty, kLimited, kLow})
      if (lower > level_ && fallen_us_[lower] + (is_below_[lower] ? since_us : 0.0) >= kFallUs)
        return lower;
    if (lasted(above_us_[kLow], kRiseUs)) return kGood;
    return level_ == kLimited && lasted(above_us_[kLimited], kRiseUs) ? kLow : level_;
  }

  /// It has fallen, or may have: the time that leaked is rounded.
  bool is_about_to_change(uint64_t now_us) const {
    for (const Level lower : {kEmpty, kLimited, kLow})
      if (lower > level_ && fallen_us_[lower] > kFallUs - static_cast<double>(kSlackUs))
        return true;
    return level_after(now_us + kSlackUs) != level_ || now_us < changed_us_ + kSlackUs;
  }

  /// How long it was below the bound of a level in all, leaking at a tenth of that pace.
  void follow_falling(Level level, uint16_t millivolts, uint64_t now_us) {
    const auto since_us = static_cast<double>(now_us - read_us_);
    const bool was_below = is_below_[level];
    is_below_[level] = millivolts < bound_of(level);
    if (level <= level_) {
      fallen_us_[level] = 0.0;
    } else if (is_below_[level]) {
      if (was_below) fallen_us_[level] += since_us;
    } else {
      fallen_us_[level] = std::max(0.0, fallen_us_[level] - since_us / 10.0);
    }
    const bool is_rested = millivolts - millivolts / 32 >= bound_of(kLow);
    if (is_below_[level]) rested_us_[level] = 0.0;
    if (is_rested) rested_us_[level] += since_us;
    if (rested_us_[level] >= kRestedUs) fallen_us_[level] = 0.0;
  }

  void follow(uint16_t millivolts, uint64_t now_us) {
    if (!has_level_) {
      has_level_ = true;
      for (const Level level : {kLow, kLimited, kEmpty})
        if (millivolts < bound_of(level)) level_ = level;
      return;
    }
    for (const Level level : {kLow, kLimited, kEmpty}) {
      follow_falling(level, millivolts, now_us);
      const bool is_above = millivolts - millivolts / 32 >= bound_of(level);
      if (!is_above)
        above_us_[level] = kNever;
      else if (above_us_[level] == kNever)
        above_us_[level] = now_us;
    }
    if (is_unsure() && above_us_[kLow] != kNever && now_us > above_us_[kLow] + kRiseUs + kSlackUs)
      stopped_ = Stopped::kNo;
    const Level before = level_;
    read_us_ = now_us;
    level_ = level_after(now_us);
    if (level_ != before) changed_us_ = now_us;
  }

  Peripheral levels_{};
  Stopped stopped_ = Stopped::kNo;
  uint64_t seen_us_ = kNever;  ///< When it was last other than 0 mV, or first read.
  uint64_t read_us_ = 0;       ///< When a control step last read it.
  bool is_read_ = false;
  bool is_broken_ = false;
  bool has_level_ = false;
  Level level_ = kGood;
  Flags is_below_{};  ///< At the last reading.
  std::array<double, kLevels> fallen_us_{};
  std::array<double, kLevels> rested_us_{};  ///< Since it was last below that bound.
  uint64_t changed_us_ = 0;
  Since above_us_ = kNone;  ///< By a 32nd.
};

}  // namespace wheelwire::explore
