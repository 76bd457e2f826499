// A trial of parameters: what ends it, and what is active afterwards.
#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using namespace wheelwire::test;

namespace {

constexpr float kTimeoutS = 0.5f;
constexpr int kTimeoutSteps = 500;

RefusalCode trial(RobotBench& bench, TrialAction action, float timeout_s = kTimeoutS) {
  return bench.refusal(ParameterTrial{.action = action, .timeout_s = timeout_s});
}

/// One on trial, of another gain and of swapped motors.
struct TrialRobot : OpenRobot {
  TrialRobot() {
    configure({{kProportionalGain, 2}});
    CHECK(trial(*this, TrialAction::kBegin) == RefusalCode::kNone);
    configure({{kProportionalGain, 5}, {kMotorsSwapped, 1}});
  }
};

bool has_former_values(const RobotBench& bench) {
  return bench.device.parameter(kProportionalGain) == 2 &&
         bench.device.parameter(kMotorsSwapped) == 0;
}

bool has_tried_values(const RobotBench& bench) {
  return bench.device.parameter(kProportionalGain) == 5 &&
         bench.device.parameter(kMotorsSwapped) == 1;
}

}  // namespace

TEST(a_trial_that_is_renewed_goes_on) {
  TrialRobot bench;
  for (int i = 0; i < 5; ++i) {
    bench.run(kTimeoutSteps - 1);
    CHECK(trial(bench, TrialAction::kRenew) == RefusalCode::kNone);
  }
  CHECK(has_tried_values(bench));
  CHECK(trial(bench, TrialAction::kRenew, 0.2f) == RefusalCode::kNone);  // a new time-out
  bench.run(200);
  CHECK(has_former_values(bench));
}

TEST(a_renewal_that_comes_late_renews_nothing) {
  TrialRobot bench;
  bench.run(kTimeoutSteps - 1);
  bench.now_us += 1'000;  // at the deadline, and before the next control step
  CHECK(trial(bench, TrialAction::kRenew) == RefusalCode::kNoTrial);
  CHECK(has_former_values(bench));
  CHECK(trial(bench, TrialAction::kKeep) == RefusalCode::kNoTrial);
}

TEST(after_a_trial_expired_its_host_neither_drives_nor_changes_anything_before_it_heard) {
  TrialRobot bench;
  bench.run(kTimeoutSteps);
  CHECK(has_former_values(bench) && bench.count(EventCode::kTrialExpired) == 1);
  bench.received.clear();
  bench.drive(0.2f, 0.2f);
  CHECK(bench.last_refusal() == RefusalCode::kNoTrial && !bench.driven());
  CHECK(bench.set(kProportionalGain, 7) == RefusalCode::kNoTrial);
  CHECK(bench.refusal(ParameterSave{}) == RefusalCode::kNoTrial);
  CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kNoTrial);
  CHECK(trial(bench, TrialAction::kBegin) == RefusalCode::kNoTrial);
  CHECK(trial(bench, TrialAction::kRevert) == RefusalCode::kNone);
  CHECK(bench.set(kProportionalGain, 7) == RefusalCode::kNone);
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

TEST(a_new_session_reverts_a_trial) {
  TrialRobot bench;
  bench.drive(0.2f, 0.2f);
  bench.send(RobotBench::hello(RobotBench::kNonce));  // a repeat of its own hello does not
  bench.step();
  CHECK(has_tried_values(bench) && bench.driven());
  bench.send(RobotBench::hello(RobotBench::kNonce + 1));
  bench.service();
  CHECK(has_former_values(bench) && !bench.driven());
  CHECK(!bench.device.on_trial());
}

TEST(on_trial_nothing_is_saved_or_reset_no_contact_switched_off_and_no_trial_begun) {
  TrialRobot bench;
  CHECK(bench.refusal(ParameterSave{}) == RefusalCode::kOnTrial);
  CHECK(bench.refusal(ParameterSave{.parameter = 1}) == RefusalCode::kOnTrial);
  CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kOnTrial);
  CHECK(bench.set(kEstopInputEnabled, 0) == RefusalCode::kOnTrial);
  CHECK(bench.set(kEstopInputEnabled, 1) == RefusalCode::kNone);  // active already
  CHECK(trial(bench, TrialAction::kBegin) == RefusalCode::kOnTrial);
  CHECK(bench.store.block.empty() && has_tried_values(bench));
  CHECK(trial(bench, TrialAction::kRevert) == RefusalCode::kNone);
  CHECK(has_former_values(bench));
}

TEST(a_reverted_stop_is_that_of_the_former_parameters) {
  TrialRobot bench;
  CHECK(bench.set(kStopMode, 1) == RefusalCode::kNone);  // coast
  bench.drive(0.2f, 0.2f);
  CHECK(trial(bench, TrialAction::kRevert) == RefusalCode::kNone);
  bench.run(3);
  CHECK(bench.brakes());
  CHECK(bench.switched_gently());
}
