// The chip's pulse counter unit (PCNT) as the firmware sets it up: x4, limits, no interrupt.
#pragma once

#include <cstdint>

#include "hal.hpp"

namespace wheelwire::sim {

enum class EdgeAction { kIncrease, kDecrease };
enum class LevelAction { kKeep, kInverse };

/// What one channel does at an edge of its edge input, given its level input.
struct CounterChannel {
  EdgeAction rising;
  EdgeAction falling;
  LevelAction level_high;
  LevelAction level_low;

  int delta(bool edge_rises, bool level) const {
    const bool increases = (edge_rises ? rising : falling) == EdgeAction::kIncrease;
    const bool keeps = (level ? level_high : level_low) == LevelAction::kKeep;
    return increases == keeps ? 1 : -1;
  }
};

class PulseCounter {
 public:
  PulseCounter(bool a, bool b) : a_(a), b_(b) {}

  void set_levels(bool a, bool b) {
    if (a != a_) {
      a_ = a;
      count(kChannelA.delta(a, b_));
    }
    if (b != b_) {
      b_ = b;
      count(kChannelB.delta(b, a_));
    }
  }

  int16_t value() const { return value_; }

 private:
  static constexpr CounterChannel kChannelA = {EdgeAction::kDecrease, EdgeAction::kIncrease,
                                               LevelAction::kKeep, LevelAction::kInverse};
  static constexpr CounterChannel kChannelB = {EdgeAction::kIncrease, EdgeAction::kDecrease,
                                               LevelAction::kKeep, LevelAction::kInverse};

  /// The hardware returns to 0 when it reaches a limit.
  void count(int delta) {
    const int next = value_ + delta;
    value_ =
        next == kCounterLimit || next == -kCounterLimit ? int16_t{0} : static_cast<int16_t>(next);
  }

  bool a_;
  bool b_;
  int16_t value_ = 0;
};

}  // namespace wheelwire::sim
