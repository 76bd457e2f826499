// When firmware that was installed over the link has passed its trial. Until then the bootloader
// reverts to the previous image at the next reset.
#pragma once

#include "protocol.hpp"

namespace wheelwire {

/// Earliest time after reset: a crash at start-up would have happened by then.
constexpr uint64_t kTrialUs = 5'000'000;

/// True once the firmware runs, its peripherals have started and a host can talk to it, and so
/// replace it again. Never while driving: marking the image as valid writes flash, which stalls
/// both cores.
constexpr bool has_proved_itself(uint64_t since_reset_us, bool has_session, SupervisorState state,
                                 uint32_t faults) {
  const bool stopped = state != SupervisorState::kBoot && state != SupervisorState::kDriving;
  return since_reset_us >= kTrialUs && has_session && stopped && !(faults & fault::kDriverFailed);
}

}  // namespace wheelwire
