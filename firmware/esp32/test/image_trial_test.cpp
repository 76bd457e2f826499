#include "image_trial.hpp"

#include "check.hpp"

using namespace wheelwire;

namespace {

bool is_kept(uint64_t since_reset_us, bool has_session, SupervisorState state, uint32_t faults) {
  return has_proved_itself(since_reset_us, has_session, state, faults);
}

}  // namespace

TEST(firmware_that_ran_long_enough_with_a_host_is_kept) {
  CHECK(is_kept(kTrialUs, true, SupervisorState::kIdle, 0));
  CHECK(is_kept(kTrialUs, true, SupervisorState::kEstopped, 0));
  CHECK(is_kept(kTrialUs, true, SupervisorState::kFault, fault::kLeftNotCounting));
}

TEST(firmware_that_did_not_prove_itself_is_not_kept) {
  CHECK(!is_kept(kTrialUs - 1, true, SupervisorState::kIdle, 0));
  CHECK(!is_kept(100 * kTrialUs, false, SupervisorState::kIdle, 0));
  CHECK(!is_kept(kTrialUs, true, SupervisorState::kFault, fault::kDriverFailed));
}

TEST(flash_is_not_written_while_driving) {
  CHECK(!is_kept(kTrialUs, true, SupervisorState::kDriving, 0));
  CHECK(!is_kept(kTrialUs, true, SupervisorState::kBoot, 0));
}
