// Keeps simulated time in step with the wall clock, by absolute deadlines.
#pragma once

#include <chrono>

#include "clock.hpp"

namespace wheelwire::sim {

class Pacer {
 public:
  using WallClock = std::chrono::steady_clock;

  /// Simulated time `now` corresponds to the present on the wall clock.
  explicit Pacer(Nanoseconds now) { anchor(now); }

  /// How far simulated time `now` is behind. After a gap (a suspended laptop, a stopped process)
  /// the lost time is skipped, not caught up.
  Nanoseconds behind(Nanoseconds now) {
    const Nanoseconds due = anchor_ + (WallClock::now() - wall_anchor_).count() - now;
    if (due > kLongestGap) anchor(now);
    return due > kLongestGap || due < 0 ? 0 : due;
  }

  /// Until the wall clock reaches simulated time `due`.
  Nanoseconds until(Nanoseconds due) const {
    const Nanoseconds wall = anchor_ + (WallClock::now() - wall_anchor_).count();
    return due > wall ? due - wall : 0;
  }

 private:
  static constexpr Nanoseconds kLongestGap = 1'000'000'000;
  static_assert(std::is_same_v<WallClock::period, std::nano>);

  void anchor(Nanoseconds now) {
    wall_anchor_ = WallClock::now();
    anchor_ = now;
  }

  WallClock::time_point wall_anchor_;
  Nanoseconds anchor_ = 0;
};

}  // namespace wheelwire::sim
