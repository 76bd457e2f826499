// Whether firmware that was installed over the link is kept. Until it is, the bootloader goes back
// to its predecessor at the next reset.
#pragma once

#include "protocol.hpp"

namespace wheelwire {

/// From reset to the earliest proof: a crash at start-up comes sooner.
constexpr uint64_t kTrialUs = 5'000'000;

/// It runs, its peripherals started, and a host can talk to it: so it can be replaced again. Never
/// while driving, for keeping it writes flash, which stalls both cores.
constexpr bool has_proved_itself(uint64_t since_reset_us, bool has_session, SupervisorState state,
                                 uint32_t faults) {
  const bool stands = state != SupervisorState::kBoot && state != SupervisorState::kDriving;
  return since_reset_us >= kTrialUs && has_session && stands && !(faults & fault::kDriverFailed);
}

}  // namespace wheelwire
