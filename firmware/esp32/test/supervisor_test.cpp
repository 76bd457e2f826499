#include "supervisor.hpp"

#include "check.hpp"

using namespace wheelwire;
using enum SupervisorState;

namespace {

void for_each_transition(auto&& visit) {
  for (size_t s = 0; s < kStateCount; ++s) {
    for (size_t e = 0; e < kEventCount; ++e) {
      const auto state = static_cast<SupervisorState>(s);
      const auto event = static_cast<SupervisorEvent>(e);
      visit(state, event, next_state(state, event));
    }
  }
}

}  // namespace

TEST(only_a_setpoint_starts_driving_and_only_its_deadline_times_out) {
  for_each_transition([](auto before, auto event, auto after) {
    if (after == before) return;
    if (after == kDriving) {
      CHECK(event == SupervisorEvent::kSetpoint);
      CHECK(before == kIdle || before == kTimedOut);
    }
    if (after == kTimedOut) CHECK(before == kDriving && event == SupervisorEvent::kDeadline);
  });
}

TEST(driving_ends_with_each_event_that_must_end_it) {
  CHECK(next_state(kDriving, SupervisorEvent::kSession) == kIdle);
  CHECK(next_state(kDriving, SupervisorEvent::kStop) == kIdle);
  CHECK(next_state(kDriving, SupervisorEvent::kDeadline) == kTimedOut);
  CHECK(next_state(kDriving, SupervisorEvent::kEstop) == kEstopped);
  CHECK(next_state(kDriving, SupervisorEvent::kFault) == kFault);
}

TEST(an_estop_latches_from_everywhere_and_a_fault_below_it_until_their_own_clears) {
  for_each_transition([](auto before, auto event, auto after) {
    if (event == SupervisorEvent::kEstop) CHECK(after == kEstopped);
    if (before == kEstopped)
      CHECK(after == (event == SupervisorEvent::kClearEstop ? kIdle : kEstopped));
    if (event == SupervisorEvent::kFault && before != kEstopped) CHECK(after == kFault);
    if (before == kFault && event != SupervisorEvent::kEstop)
      CHECK(after == (event == SupervisorEvent::kClearFault ? kIdle : kFault));
  });
}

TEST(boot_ends_when_started_and_never_drives) {
  for_each_transition([](auto before, auto event, auto after) {
    if (before != kBoot) {
      CHECK(after != kBoot);
    } else if (event == SupervisorEvent::kStarted) {
      CHECK(after == kIdle);
    } else {
      CHECK(after == kBoot || after == kEstopped || after == kFault);
    }
  });
}

TEST(a_setpoint_is_refused_exactly_where_it_does_not_drive) {
  for (size_t s = 0; s < kStateCount; ++s) {
    const auto state = static_cast<SupervisorState>(s);
    const bool drives = next_state(state, SupervisorEvent::kSetpoint) == kDriving;
    CHECK(drives == (setpoint_refusal(state) == RefusalCode::kNone));
  }
}
