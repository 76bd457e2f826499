#include "robot.hpp"

namespace wheelwire {

Robot::Robot(const Hal& hal, const Identity& identity, const ParameterSpec* specs)
    : hal_(hal),
      identity_(identity),
      parameters_(specs),
      config_(make_config(parameters_)),
      link_(hal.line),
      drive_(hal.left_motor, hal.right_motor) {}

void Robot::start(uint64_t now_us) {
  store_state_ = parameters_.load(hal_.store);
  store_faults_ = hal_.store.faults();
  apply_parameters();
  drive_.start(hal_.encoders.latch());
  last_step_us_ = now_us;
  apply(SupervisorEvent::kStarted, now_us);
}

void Robot::step(uint64_t now_us) {
  if (parameters_changed_) apply_parameters();
  const EncoderCounts counts = hal_.encoders.latch();
  encoder_us_ = counts.t_us;
  left_illegal_ = counts.left_illegal;
  right_illegal_ = counts.right_illegal;
  drive_.note_battery(hal_.battery.millivolts(), config_);
  // Before the link is read: what it says may clear a fault only once that has been told.
  trip(drive_.latch(counts, config_) | check_timing(now_us), now_us);
  service_link(now_us);
  check_contact(now_us);
  check_deadline(now_us);
  actuate(now_us);
  stream_state(now_us);
}

void Robot::hang_up(uint64_t now_us) {
  session_.close();
  setpoint_ = {};
  state_interval_us_ = 0;
  apply(SupervisorEvent::kStop, now_us);
}

void Robot::report_driver_failure() { driver_failed_ = true; }

uint32_t Robot::check_timing(uint64_t now_us) {
  const uint64_t elapsed_us = now_us - last_step_us_;
  last_step_us_ = now_us;
  if (elapsed_us > config_.period_us + config_.period_us / 2) ++overruns_;
  if (elapsed_us > latest_step_us_) latest_step_us_ = static_cast<uint32_t>(elapsed_us);
  // Standing still, a late step (a flash write, say) hurts nobody.
  const bool fails = supervisor_.may_drive() && elapsed_us > config_.overrun_limit_us;
  return fails ? fault::kControlOverrun : 0;
}

void Robot::trip(uint32_t faults, uint64_t now_us) {
  faults |= lasting_faults();
  if ((faults & ~faults_) != 0) ++faults_tripped_;
  faults_ |= faults;
  if (faults_ != 0) apply(SupervisorEvent::kFault, now_us);
}

void Robot::check_contact(uint64_t now_us) {
  if (config_.estop_input_enabled && hal_.estop.is_open()) apply(SupervisorEvent::kEstop, now_us);
}

void Robot::check_deadline(uint64_t now_us) {
  if (supervisor_.may_drive() && now_us >= setpoint_.deadline_us)
    apply(SupervisorEvent::kDeadline, now_us);
}

/// Those that cannot be cleared yet. Where saved parameters exist that could not be read, the robot
/// would drive as nobody set it up: so it does not.
uint32_t Robot::lasting_faults() const {
  return store_faults_ | (driver_failed_ ? fault::kDriverFailed : 0);
}

void Robot::actuate(uint64_t now_us) {
  if (supervisor_.may_drive()) {
    drive_.follow(setpoint_.mode, setpoint_.target, config_);
  } else {
    drive_.keep_stopped(now_us);
  }
}

/// The one place where the supervisor's state changes, and where leaving DRIVING removes the drive.
void Robot::apply(SupervisorEvent event, uint64_t now_us, StopMode mode) {
  const SupervisorState before = supervisor_.state();
  if (!supervisor_.apply(event)) return;
  if (before == SupervisorState::kDriving) drive_.begin_stop(mode, now_us, config_);
  if (!session_.is_open()) return;
  link_.send(Event{
      .boot_id = identity_.boot_id,
      .t_us = static_cast<uint32_t>(now_us),
      .code = EventCode::kSupervisor,
      .cause = event,
      .before = before,
      .after = supervisor_.state(),
      .faults = static_cast<uint16_t>(faults_),
  });
}

void Robot::stream_state(uint64_t now_us) {
  if (state_interval_us_ == 0 || now_us < next_state_us_) return;
  next_state_us_ += state_interval_us_;
  // After a gap the missed frames are not sent in a burst.
  if (next_state_us_ <= now_us) next_state_us_ = now_us + state_interval_us_;
  const Wheel& left = drive_.left();
  const Wheel& right = drive_.right();
  link_.send(WheelState{
      .boot_id = identity_.boot_id,
      .t_us = static_cast<uint32_t>(encoder_us_),
      .left_ticks = left.ticks(),
      .right_ticks = right.ticks(),
      .left_mps = to_mps(left.velocity_umps()),
      .right_mps = to_mps(right.velocity_umps()),
      .left_duty_q15 = static_cast<int16_t>(left.duty_q15()),
      .right_duty_q15 = static_cast<int16_t>(right.duty_q15()),
      .command_seq = setpoint_.command_seq,
      .supervisor = supervisor_.state(),
      .faults = static_cast<uint16_t>(faults_),
      .overruns = static_cast<uint16_t>(overruns_),
      .battery_mv = hal_.battery.millivolts(),
  });
}

void Robot::set_stream_rate(uint32_t rate_hz, uint64_t now_us) {
  state_interval_us_ = rate_hz == 0 ? 0 : 1'000'000 / rate_hz;
  next_state_us_ = now_us;
}

/// While driving only at the beginning of a control step, so that each works with one
/// configuration.
void Robot::apply_parameters() {
  parameters_changed_ = false;
  config_ = make_config(parameters_);
  drive_.note_parameters();
  setpoint_.target = limited(setpoint_.mode, setpoint_.asked);
}

WheelPair Robot::limited(ControlMode mode, WheelPair asked) const {
  return scale_to_limit(
      asked, mode == ControlMode::kVelocity ? config_.max_velocity_umps : config_.gains.limit_q15);
}

/// A host that connects is told once a session what became of its saved parameters.
void Robot::announce_store() {
  if (store_state_ == Parameters::Load::kLoaded || store_faults_ != 0) return;
  link_.send(Event{
      .boot_id = identity_.boot_id,
      .t_us = static_cast<uint32_t>(last_step_us_),
      .code = store_state_ == Parameters::Load::kEmpty ? EventCode::kStoreEmpty
                                                       : EventCode::kStoreDefaulted,
      .before = supervisor_.state(),
      .after = supervisor_.state(),
      .faults = static_cast<uint16_t>(faults_),
  });
}

}  // namespace wheelwire
