// Decides for the dead-man's interrupt whether wheels that are braked, or roll freely, may stay so
// while no control step runs. It is inlined: flash may be inaccessible in the interrupt.
#pragma once

#include "hal.hpp"
#include "step_watch.hpp"

namespace wheelwire {

/// Whether a stage with these inputs neither drives nor chops: all of them are at the levels of its
/// row "coast" or "brake". A full duty alone does not mean a brake: it may drive.
constexpr bool stands_still(const StageTable& stage, const StageOutputs& outputs) {
  const auto shows = [&](StageAction action) {
    const StageLevel* const row = stage.rows[static_cast<size_t>(action)];
    for (size_t i = 0; i < kStageInputs; ++i) {
      const uint16_t duty_q15 = outputs.duty_q15[i];
      if (duty_q15 != 0 && duty_q15 != kHigh_q15) return false;
      if (row[i] == StageLevel::kLow && duty_q15 != 0) return false;
      if (row[i] == StageLevel::kHigh && duty_q15 != kHigh_q15) return false;
    }
    return true;
  };
  return shows(StageAction::kCoast) || shows(StageAction::kBrake);
}

/// The longest hold: what a flash operation may take. The task watchdog waits as long for one, and
/// without one 100 ms; then it ends the hold with a panic.
constexpr uint32_t kMaxHoldUs = 5'000'000;

class BrakeHold {
 public:
  /// Call it with each result of StepWatch::check(), every kWatchPeriodUs. `stopped`: no step has
  /// come for too long. `still`: the last step did not drive, and since then no step drove a wheel.
  /// True as long as the motors must be released.
  [[gnu::always_inline]] bool must_release(bool stopped, bool still) {
    if (!stopped) {
      held_ = 0;
      return false;
    }
    if (!still || held_ >= kMaxHoldUs / kWatchPeriodUs) return true;
    ++held_;
    return false;
  }

 private:
  uint32_t held_ = 0;  ///< Checks for which the outputs were held.
};

}  // namespace wheelwire
