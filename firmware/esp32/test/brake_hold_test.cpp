#include "brake_hold.hpp"

#include "check.hpp"

using namespace wheelwire;

namespace {

constexpr uint32_t kLimit = checks_without_a_step(1000);
constexpr uint32_t kHoldChecks = kMaxHoldUs / kWatchPeriodUs;

StageOutputs outputs_of(const StageTable& stage, StageAction action, uint16_t duty_q15,
                        uint16_t kept_q15) {
  StageOutputs outputs;
  const StageLevel* const row = stage.rows[static_cast<size_t>(action)];
  for (size_t i = 0; i < kStageInputs; ++i) {
    const StageLevel level = row[i];
    const bool exists = (stage.inputs >> i & 1) != 0;
    outputs.duty_q15[i] = level == StageLevel::kLow    ? uint16_t{0}
                          : level == StageLevel::kHigh ? kHigh_q15
                          : level == StageLevel::kPwm  ? duty_q15
                          : exists                     ? kept_q15
                                                       : uint16_t{0};
  }
  return outputs;
}

/// The dead-man's interrupt.
struct Interrupt {
  StepWatch watch;
  BrakeHold hold;
  uint32_t steps = 0;

  bool releases(bool still) { return hold.must_release(watch.check(steps, kLimit), still); }
};

}  // namespace

TEST(coast_and_brake_stand_still_on_every_stage_and_no_drive_does) {
  for (const StageTable& stage : kStageTables) {
    for (const uint16_t kept_q15 : {uint16_t{0}, kHigh_q15}) {
      CHECK(stands_still(stage, outputs_of(stage, StageAction::kCoast, 0, kept_q15)));
      CHECK(stands_still(stage, outputs_of(stage, StageAction::kBrake, 0, kept_q15)));
      for (const StageAction action : {StageAction::kForward, StageAction::kReverse})
        for (const int duty_q15 : {1, 100, 16'384, 32'766, 32'767})
          CHECK(!stands_still(
              stage, outputs_of(stage, action, static_cast<uint16_t>(duty_q15), kept_q15)));
    }
  }
}

TEST(a_brake_stays_on_while_no_step_comes_until_the_slow_watchdog) {
  Interrupt interrupt;
  uint32_t held = 0;
  while (!interrupt.releases(true)) ++held;
  CHECK(held >= kHoldChecks && held <= kHoldChecks + kLimit);
  // And from then on, until a step comes.
  for (int i = 0; i < 100; ++i) CHECK(interrupt.releases(true));
  ++interrupt.steps;
  CHECK(!interrupt.releases(true));
}

TEST(each_flash_operation_has_the_whole_time) {
  Interrupt interrupt;
  for (int operation = 0; operation < 5; ++operation) {
    for (uint32_t i = 0; i < kHoldChecks; ++i) CHECK(!interrupt.releases(true));
    ++interrupt.steps;
    CHECK(!interrupt.releases(true));
  }
}

TEST(a_drive_that_hangs_is_released_within_the_step_watch_s_limit) {
  Interrupt interrupt;
  ++interrupt.steps;
  CHECK(!interrupt.releases(false));
  uint32_t checks = 1;
  while (!interrupt.releases(false)) ++checks;
  CHECK(checks == kLimit);
}

TEST(a_step_that_begins_to_drive_and_hangs_ends_the_hold_at_once) {
  Interrupt interrupt;
  for (int i = 0; i < 1000; ++i) CHECK(!interrupt.releases(true));
  CHECK(interrupt.releases(false));
}
