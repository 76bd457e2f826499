// Whether control steps still come: what a dead-man's interrupt decides. It looks at a count of
// steps alone, needs no clock, and is inlined, for flash may be out of reach.
#pragma once

#include <stdint.h>

namespace wheelwire {

/// How often an interrupt looks.
constexpr uint32_t kWatchPeriodUs = 1000;

/// At most this many looks without a step, so that the drive is removed within 20 ms of any
/// deadline: the last step came before the deadline, or it removed the drive itself.
constexpr uint32_t kMostLooks = 15;

/// After how many looks without a step the drive is removed: five control periods, at least 5 ms.
constexpr uint32_t looks_without_a_step(uint32_t control_period_us) {
  constexpr uint32_t kFewest = 5;
  const uint32_t looks = (5 * control_period_us + kWatchPeriodUs - 1) / kWatchPeriodUs;
  return looks < kFewest ? kFewest : looks > kMostLooks ? kMostLooks : looks;
}

/// From the last step to the drive's removal, at most: the first look comes within a period.
constexpr uint32_t kLongestWatchUs = (kMostLooks + 1) * kWatchPeriodUs;

class StepWatch {
 public:
  /// Once every kWatchPeriodUs. True as long as the drive must be off: a step that hangs may switch
  /// it on once more.
  [[gnu::always_inline]] bool look(uint32_t steps, uint32_t limit) {
    if (steps != seen_) {
      seen_ = steps;
      looks_ = 0;
      return false;
    }
    if (looks_ < limit) ++looks_;
    return looks_ >= limit;
  }

 private:
  uint32_t seen_ = 0;
  uint32_t looks_ = 0;  ///< Since the last step.
};

}  // namespace wheelwire
