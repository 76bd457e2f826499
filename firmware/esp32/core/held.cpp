// What holds the robot, and what ended its last motion: see protocol/SPEC.md, "What holds it". It
// decides nothing.
#include "message_server.hpp"

namespace wheelwire {
namespace {

/// Between two reports of changes: inputs that chatter do not fill the line.
constexpr uint64_t kLeastUs = 100'000;
/// A report may be lost on the way.
constexpr uint64_t kRepeatUs = 1'000'000;

constexpr uint16_t saturate16(uint32_t value) {
  return static_cast<uint16_t>(value < UINT16_MAX ? value : UINT16_MAX);
}

}  // namespace

uint32_t Robot::held(uint64_t now_us) const {
  uint32_t flags = 0;
  const SupervisorState state = supervisor_.state();
  if (state == SupervisorState::kBoot) flags |= held::kBooting;
  if (state == SupervisorState::kEstopped) flags |= held::kEstop;
  if (contact_open_) flags |= held::kContact;
  if (faults_ != 0) flags |= held::kFault;
  if ((reflexes_ & reflex::kUnread) != 0) flags |= held::kSensorsUnread;
  if (contradictions_ != 0) flags |= held::kContradiction;
  if (trial_.refusal() != RefusalCode::kNone) flags |= held::kTrialOver;
  // A program that sends no motion is not held by this. While latched, a clear comes first.
  const bool is_gap = now_us - quiet_since_us_ >= config_.rearm_gap_us;
  if (unarmed_ == 0 || !is_refused_ || is_latched() || is_gap) return flags;
  if ((unarmed_ & kUnarmed) != 0) flags |= held::kUnarmed;
  if ((unarmed_ & reflex::kNoForward) != 0) flags |= held::kUnarmedForward;
  if ((unarmed_ & reflex::kNoReverse) != 0) flags |= held::kUnarmedReverse;
  return flags;
}

/// A setpoint was obeyed that turns a wheel. So that a reset finds that the robot moved.
void Robot::begin_motion() {
  if (target_.is_zero() || forbids(forbidden(), target_)) return;
  moves_ = true;
  driver_ = session_id_;
  note_latches();
}

void Robot::end_motion(StopCause cause, uint64_t now_us) {
  moves_ = false;
  latches_.stop() = {.held = observer_.sensed(),
                     .session = driver_,
                     .command = setpoint_.command_seq,
                     .faults = static_cast<uint16_t>(faults_),
                     .mmps = saturate16(static_cast<uint32_t>(drive_.speed_umps()) / 1000),
                     .cause = cause};
  stop_us_ = now_us;
  stop_ticks_[0] = drive_.left().ticks();
  stop_ticks_[1] = drive_.right().ticks();
  ++stop_news_;
  note_latches();
}

/// One by the sensors alone is named by them.
StopCause Robot::cause_of(uint32_t new_faults) const {
  if (new_faults != fault::kExternal) return StopCause::kFault;
  const uint32_t sensed = observer_.sensed();
  if ((sensed & held::kCliff) != 0) return StopCause::kCliff;
  if ((sensed & held::kFaultInput) != 0) return StopCause::kFaultInput;
  if ((sensed & (held::kBattery | held::kBatteryUnknown)) != 0) return StopCause::kBattery;
  return StopCause::kFault;
}

void Robot::follow_stop() {
  LastStop& stop = latches_.stop();
  // In a new motion it is not known where the last one ended.
  if (moves_ || stop_us_ == 0 || stop.is_over()) return;
  const auto turned = [](const Wheel& wheel, int32_t from) {
    return magnitude(wrapped_difference(wheel.ticks(), from));
  };
  const int32_t left = turned(drive_.left(), stop_ticks_[0]);
  const int32_t right = turned(drive_.right(), stop_ticks_[1]);
  stop.rolled_mm = saturate16(static_cast<uint32_t>(
      multiply_shift(left > right ? left : right, config_.um_per_tick_q10, 10) / 1000));
  if (!drive_.is_still()) return;
  stop.flags |= stopflag::kAtRest;
  ++stop_news_;
  latches_.note_stop();
}

uint32_t MessageServer::configuration_held() const {
  if (configuration_ == nullptr) return 0;
  switch (configuration_->state()) {
    case ConfigurationState::kDamaged:
      return held::kConfigurationUnusable;
    case ConfigurationState::kBuiltIn:
      return held::kConfigurationUnconfirmed;
    case ConfigurationState::kTrial:
      return held::kConfigurationOnTrial;
    case ConfigurationState::kStored:
      break;
  }
  return 0;
}

uint32_t MessageServer::held(uint64_t now_us) const {
  return robot_.held(now_us) | sensed() | configuration_held() |
         (restart_us_ != 0 ? held::kBooting : 0);
}

Hold MessageServer::hold(uint64_t now_us) const {
  const LastStop& stop = robot_.last_stop();
  return {.session_id = session_.id(),
          .held = held(now_us),
          .estop_source = robot_.estop_source(),
          .contradictions = robot_.active_contradictions(),
          .stop_cause = stop.cause,
          .stop_flags = stop.flags,
          .stop_reset = stop.reset,
          .stop_held = stop.held,
          .stop_faults = stop.faults,
          .stop_session = stop.session,
          .stop_command = stop.command,
          .stop_us = robot_.stop_us(),
          .stop_mmps = stop.mmps,
          .rolled_mm = stop.rolled_mm};
}

/// Every change, at a bounded rate, and now and then what has not changed.
void MessageServer::report_hold(uint64_t now_us) {
  next_look_us_ = now_us + kLookUs;
  robot_.follow_stop();
  if (!session_.is_open()) return;
  const Reported found{.held = held(now_us),
                       .contradictions = robot_.active_contradictions(),
                       .stop_news = robot_.stop_news(),
                       .is_any = true};
  if (reported_.is_any && now_us - reported_us_ < (found == reported_ ? kRepeatUs : kLeastUs))
    return;
  reported_us_ = now_us;
  reported_ = found;
  link_.send(hold(now_us));
}

}  // namespace wheelwire
