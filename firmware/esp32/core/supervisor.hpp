// The safety supervisor: one transition table decides whether the outputs may drive.
#pragma once

#include "protocol.hpp"

namespace wheelwire {

constexpr size_t kStateCount = 6;
constexpr size_t kEventCount = 9;

/// The state after `event` in `state`; `state` itself if the event changes nothing.
SupervisorState next_state(SupervisorState state, SupervisorEvent event);

/// Why a setpoint is refused in `state`; kNone if it is obeyed.
RefusalCode setpoint_refusal(SupervisorState state);

/// Why a parameter may not change in `state`; kNone if it may. `turns`: a wheel does, though
/// nothing may drive it.
RefusalCode change_refusal(SupervisorState state, bool turns, ParameterChanges changes);

class Supervisor {
 public:
  SupervisorState state() const { return state_; }
  bool may_drive() const { return state_ == SupervisorState::kDriving; }

  /// Returns true when the state changed.
  bool apply(SupervisorEvent event) {
    const SupervisorState before = state_;
    state_ = next_state(before, event);
    return state_ != before;
  }

 private:
  SupervisorState state_ = SupervisorState::kBoot;
};

}  // namespace wheelwire
