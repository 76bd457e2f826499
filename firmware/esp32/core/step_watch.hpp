// Detects that control steps have stopped, for the dead-man's interrupt. It only compares a count
// of steps, needs no clock, and is inlined: flash may be inaccessible in the interrupt.
#pragma once

#include <stdint.h>

namespace wheelwire {

/// Period of the interrupt that checks.
constexpr uint32_t kWatchPeriodUs = 1000;

/// Limit of the checks without a step, so that the drive is removed within 20 ms of any deadline:
/// the last step came before the deadline, or it removed the drive itself.
constexpr uint32_t kMaxChecks = 15;

/// After how many checks without a step the drive is removed: five control periods, at least 5 ms.
constexpr uint32_t checks_without_a_step(uint32_t control_period_us) {
  constexpr uint32_t kMinChecks = 5;
  const uint32_t checks = (5 * control_period_us + kWatchPeriodUs - 1) / kWatchPeriodUs;
  return checks < kMinChecks ? kMinChecks : checks > kMaxChecks ? kMaxChecks : checks;
}

/// The longest time from the last step to the drive's removal: the first check comes within a
/// period of the step.
constexpr uint32_t kMaxWatchUs = (kMaxChecks + 1) * kWatchPeriodUs;

class StepWatch {
 public:
  /// Call every kWatchPeriodUs. True as long as the drive must be off, not only once: a step that
  /// hangs may still switch it on.
  [[gnu::always_inline]] bool check(uint32_t steps, uint32_t limit) {
    if (steps != seen_) {
      seen_ = steps;
      checks_ = 0;
      return false;
    }
    if (checks_ < limit) ++checks_;
    return checks_ >= limit;
  }

 private:
  uint32_t seen_ = 0;
  uint32_t checks_ = 0;  ///< Since the last step.
};

}  // namespace wheelwire
