// Turns the chip's counter register into a running total of ticks.
#pragma once

#include "hal.hpp"

namespace wheelwire {

/// The true change between two reads of a counter that returns to 0 at +-kCounterLimit: the raw
/// difference modulo kCounterLimit, exact below half of it (16 383 ticks between two steps).
constexpr int32_t counter_change(int16_t before, int16_t now) {
  int32_t change = (now - before) % kCounterLimit;
  if (change > kCounterLimit / 2) change -= kCounterLimit;
  if (change < -(kCounterLimit / 2)) change += kCounterLimit;
  return change;
}

/// Cumulative ticks, modulo 2^32. The register is never cleared, so nothing is lost between a read
/// and a clear.
class TickTotal {
 public:
  explicit TickTotal(int16_t counter = 0) : counter_(counter) {}

  /// Returns the change since the last call, forward positive.
  int32_t update(int16_t counter, bool inverted) {
    const int32_t change = counter_change(counter_, counter);
    counter_ = counter;
    const int32_t forward = inverted ? -change : change;
    ticks_ += static_cast<uint32_t>(forward);
    return forward;
  }

  /// From now on each counts from the other's register. The totals do not change.
  void exchange_registers(TickTotal& other) {
    const int16_t counter = counter_;
    counter_ = other.counter_;
    other.counter_ = counter;
  }

  int32_t ticks() const { return static_cast<int32_t>(ticks_); }

 private:
  int16_t counter_;
  uint32_t ticks_ = 0;
};

}  // namespace wheelwire
