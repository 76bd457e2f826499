#include "supervisor.hpp"

namespace wheelwire {
namespace {

using enum SupervisorState;

// Rows: SupervisorState. Columns: SupervisorEvent. While the cause of an e-stop or a fault is
// present, Robot refuses to clear it and applies no event.
constexpr SupervisorState kTable[kStateCount][kEventCount] = {
    // clang-format off
    // kStarted   kSession    kSetpoint  kStop      kDeadline   kEstop     kClearEstop kFault     kClearFault
    {kIdle,       kBoot,      kBoot,     kBoot,     kBoot,      kEstopped, kBoot,      kFault,    kBoot},
    {kIdle,       kIdle,      kDriving,  kIdle,     kIdle,      kEstopped, kIdle,      kFault,    kIdle},
    {kDriving,    kIdle,      kDriving,  kIdle,     kTimedOut,  kEstopped, kDriving,   kFault,    kDriving},
    {kTimedOut,   kIdle,      kDriving,  kIdle,     kTimedOut,  kEstopped, kTimedOut,  kFault,    kTimedOut},
    {kEstopped,   kEstopped,  kEstopped, kEstopped, kEstopped,  kEstopped, kIdle,      kEstopped, kEstopped},
    {kFault,      kFault,     kFault,    kFault,    kFault,     kEstopped, kFault,     kFault,    kIdle},
    // clang-format on
};

}  // namespace

SupervisorState next_state(SupervisorState state, SupervisorEvent event) {
  return kTable[static_cast<size_t>(state)][static_cast<size_t>(event)];
}

RefusalCode setpoint_refusal(SupervisorState state) {
  switch (state) {
    case kBoot:
      return RefusalCode::kBooting;
    case kEstopped:
      return RefusalCode::kEstopped;
    case kFault:
      return RefusalCode::kFault;
    case kIdle:
    case kDriving:
    case kTimedOut:
      return RefusalCode::kNone;
  }
  return RefusalCode::kBooting;
}

RefusalCode change_refusal(SupervisorState state, bool turns, ParameterChanges changes) {
  if (state == kBoot) return RefusalCode::kBooting;
  const bool allowed = changes == ParameterChanges::kAlways ||
                       (state != kDriving && !turns &&
                        (state != kEstopped || changes == ParameterChanges::kStopped));
  return allowed ? RefusalCode::kNone : RefusalCode::kNotStopped;
}

}  // namespace wheelwire
