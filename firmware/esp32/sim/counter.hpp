// The chip's pulse counter unit (PCNT) as the firmware sets it up: x4, limits, no interrupt.
#pragma once

#include <cstdint>

#include "hal.hpp"

namespace wheelwire::sim {

class PulseCounter {
 public:
  PulseCounter(bool a, bool b) : a_(a), b_(b) {}

  /// Channel A counts A's edges by B's level, and channel B the other way round: up where A leads.
  void set_levels(bool a, bool b) {
    if (a != a_) {
      a_ = a;
      count(a != b_ ? 1 : -1);
    }
    if (b != b_) {
      b_ = b;
      count(b == a_ ? 1 : -1);
    }
  }

  int16_t value() const { return value_; }

 private:
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
