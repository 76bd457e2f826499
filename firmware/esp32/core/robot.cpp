#include "robot.hpp"

#include "contradictions.hpp"
#include "deadline.hpp"
#include "slew.hpp"

namespace wheelwire {

Robot::Robot(const Hal& hal, RobotObserver& observer, const ParameterSpec* specs,
             const BoardFacts& board)
    : hal_(hal),
      observer_(observer),
      board_(board),
      config_(make_config(Parameters(specs, board.checksum))),
      drive_(hal.left_motor, hal.right_motor),
      latches_(hal.latches, hal.latch_store),
      parameters_(specs, board.checksum),
      trial_(parameters_) {}

void Robot::start(ResetReason reason, uint64_t now_us) {
  store_state_ = parameters_.load(hal_.store);
  store_faults_ = hal_.store.faults();
  if (store_state_ == Parameters::Load::kDamaged && store_faults_ == 0)
    store_faults_ = fault::kStoreUnreadable;
  apply_parameters();
  counts_ = hal_.encoders.latch();
  if (config_.encoders_swapped) counts_ = counts_.exchanged();
  drive_.start(counts_);
  last_step_us_ = now_us;
  const Latches before = latches_.start();
  for (size_t i = 0; i < kStoredBlocks; ++i) {
    BlockStore* const store = store_of(i);
    if (store == nullptr) continue;
    if (store->has_lost_copy()) lost_copies_ |= static_cast<uint8_t>(1 << i);
    if (store->is_incomplete()) repairs_ |= static_cast<uint8_t>(1 << i);
  }
  faults_ = before.faults;
  if (before.battery_at_stop) reflexes_ |= kBatteryAtStop;
  if (before.moves)
    latches_.stop() = {.session = before.driver, .cause = StopCause::kReset, .reset = reason};
  latches_.stop().flags |= stopflag::kEarlierStart;
  quiet_since_us_ = drove_us_ = now_us;
  if (before.holds) stop_action_.begin(StopMode::kBrakeUntilDriven, false, now_us, 0);
  apply(SupervisorEvent::kStarted, now_us);
  // Also one that came by a message while the device started: only now it knows how to stop.
  if (before.estop || supervisor_.state() == SupervisorState::kEstopped)
    estop(before.source, now_us);
  trip(0, now_us);
  note_latches();
}

// --- the control step ----------------------------------------------------------------------------

void Robot::begin_step(uint64_t now_us) {
  // The inputs first, so that a recorder has them before anything happens because of them.
  counts_ = hal_.encoders.latch();
  const uint16_t battery_mv = hal_.battery.millivolts();
  if (recorder_ != nullptr) note_step(now_us, battery_mv);
  check_trial(now_us);
  if (parameters_changed_) apply_parameters();
  if (config_.encoders_swapped) counts_ = counts_.exchanged();
  drive_.note_battery(battery_mv, config_);
  uint32_t faults = drive_.latch(counts_, config_) | check_timing(now_us);
  if (stopped_by_sensors() && supervisor_.may_drive()) faults |= fault::kExternal;
  trip(faults, now_us);
}

void Robot::finish_step(uint64_t now_us) {
  // Not by `check_contact`: each step would pay for the call.
  const bool is_open = contact_is_open();
  if (is_open != contact_open_) note_contact(is_open, now_us);
  if (supervisor_.may_drive() && has_passed(setpoint_.expiry_us, now_us)) {
    begin_action(StopMode::kConfigured, false, now_us);
    apply(SupervisorEvent::kDeadline, now_us, StopCause::kDeadline);
  }
  actuate(now_us);
}

void Robot::note_step(uint64_t now_us, uint16_t battery_mv) {
  recorder_->note_step({.now_us = now_us,
                        .t_us = counts_.t_us,
                        .left_counter = counts_.left,
                        .right_counter = counts_.right,
                        .left_illegal = counts_.left_illegal,
                        .right_illegal = counts_.right_illegal,
                        .battery_mv = battery_mv,
                        .left_duty_q15 = static_cast<int16_t>(drive_.left().duty_q15()),
                        .right_duty_q15 = static_cast<int16_t>(drive_.right().duty_q15())});
}

uint32_t Robot::check_timing(uint64_t now_us) {
  const uint64_t elapsed_us = now_us - last_step_us_;
  last_step_us_ = now_us;
  if (elapsed_us > config_.period_us + config_.period_us / 2) ++late_steps_;
  if (elapsed_us > longest_interval_us_) longest_interval_us_ = static_cast<uint32_t>(elapsed_us);
  // At rest a late step does no harm. A setpoint may have come in the same step as a write to
  // flash, and then the drive only began after it.
  const bool fails = supervisor_.may_drive() && !stalled_ && elapsed_us > config_.overrun_limit_us;
  stalled_ = false;
  return fails ? fault::kControlOverrun : 0;
}

void Robot::latch_faults(uint32_t faults, uint64_t now_us) {
  const uint32_t new_faults = faults & ~faults_;
  const bool is_new = new_faults != 0;
  if (is_new || !is_latched()) begin_action(mode_at(new_faults), false, now_us);
  faults_ |= faults;
  apply(SupervisorEvent::kFault, now_us, cause_of(new_faults));
  if (!is_new) return;
  ++faults_tripped_;
  note_latches();
}

bool Robot::contact_is_open() {
  const bool is_open = board_.is_confirmed && config_.estop_input_enabled && hal_.estop.is_open();
  if (recorder_ != nullptr) recorder_->note_contact(is_open);
  return is_open;
}

void Robot::actuate(uint64_t now_us) {
  if (!supervisor_.may_drive()) return stand_still(now_us);
  if (forbidden() != 0) return actuate_within_reflexes(now_us);
  follow();
}

void Robot::note_speed(uint64_t now_us) {
  const int32_t speed_umps = drive_.speed_umps();
  if (speed_umps >= config_.rolling_umps || drive_.is_still()) not_slow_us_ = now_us;
  if (rolling_.update(speed_umps, now_us, config_.rolling_umps, config_.velocity_window_us))
    observer_.on_rolling(speed_umps, now_us);
}

void Robot::stand_still(uint64_t now_us) {
  const bool estopped = supervisor_.state() == SupervisorState::kEstopped;
  const bool brakes =
      stop_action_.brakes(now_us, drive_.is_still(), estopped) && board_.may_brake();
  keep_stopped(brakes, now_us);
  sync_latches(brakes, now_us);
}

/// Writing to flash stalls the chip, so the wheels must stand first. Wheels that creep on an
/// e-stop's brake are also accepted, because on a slope they might never stand. The brake stays on
/// during the write.
void Robot::sync_latches(bool brakes, uint64_t now_us) {
  const bool creeps = brakes && supervisor_.state() == SupervisorState::kEstopped &&
                      now_us - drove_us_ >= kRunDownUs && now_us - not_slow_us_ >= kSlowUs;
  if (!creeps && !is_at_rest(now_us)) return;
  if (latches_.sync_at_rest(now_us)) {
    note_write(!latches_.write_failed());
  } else if (repairs_ != 0 && now_us >= next_repair_us_) {
    repair_one(now_us);
  }
}

BlockStore* Robot::store_of(size_t block) {
  BlockStore* const stores[kStoredBlocks] = {hal_.configuration, &hal_.store, &hal_.latch_store};
  return stores[block];
}

void Robot::repair_one(uint64_t now_us) {
  const auto block = static_cast<size_t>(__builtin_ctz(repairs_));
  const bool done = store_of(block)->repair();
  if (done) repairs_ &= static_cast<uint8_t>(~(1 << block));
  if (!done) next_repair_us_ = now_us + kRepairIntervalUs;
  note_write(done);
}

/// Records the latches, so that a reset of the processor finds them.
void Robot::note_latches() {
  // Not the fault of a missing board: nothing was driven, and each start checks again.
  latches_.note({.estop = supervisor_.state() == SupervisorState::kEstopped,
                 .holds = stop_action_.holds(),
                 .battery_at_stop = (reflexes_ & kBatteryAtStop) != 0,
                 .faults = faults_ & ~fault::kNoBoard,
                 .source = estop_source_,
                 .moves = moves_,
                 .driver = driver_});
}

/// The only place where the supervisor's state changes, so that leaving DRIVING always removes the
/// drive.
void Robot::apply(SupervisorEvent event, uint64_t now_us, StopCause cause) {
  const SupervisorState before = supervisor_.state();
  if (!supervisor_.apply(event)) return;
  if (before == SupervisorState::kDriving) {
    drive_.release();
    drove_us_ = now_us;
    if (moves_) end_motion(cause, now_us);
  }
  if (supervisor_.may_drive()) change_action([this] { stop_action_.end(); });
  // The other latches are recorded where they change.
  if (before == SupervisorState::kEstopped || supervisor_.state() == SupervisorState::kEstopped)
    note_latches();
  if (recorder_ != nullptr) recorder_->note_transition(event, before, supervisor_.state(), faults_);
  observer_.on_transition({event, before, supervisor_.state()}, now_us);
}

// --- stops ---------------------------------------------------------------------------------------

void Robot::stop(StopMode mode, bool by_session, uint64_t now_us) {
  const bool may_weaken = by_session && mode != StopMode::kConfigured && !is_latched();
  if (!by_session && mode < config_.stop_mode) mode = StopMode::kConfigured;
  begin_action(mode, may_weaken, now_us);
  apply(SupervisorEvent::kStop, now_us, by_session ? StopCause::kStop : StopCause::kStopOther);
}

void Robot::estop(EstopSource source, uint64_t now_us) {
  // Who was first has latched it.
  if (estop_source_ == EstopSource::kNone) estop_source_ = source;
  if (supervisor_.state() != SupervisorState::kBoot)
    change_action([&] { stop_action_.begin_estop(estop_mode(), now_us, config_.brake_time_us); });
  apply(SupervisorEvent::kEstop, now_us,
        source == EstopSource::kContact   ? StopCause::kEstopContact
        : source == EstopSource::kSession ? StopCause::kEstopSession
                                          : StopCause::kEstopOther);
}

/// A robot that is too fast is not left to roll on. A power stage that reports a fault is to be
/// switched off.
StopMode Robot::mode_at(uint32_t new_faults) const {
  if ((new_faults & fault::kOverspeed) != 0) return StopMode::kBrakeUntilDriven;
  const bool is_of_stage = new_faults == fault::kExternal && (reflexes_ & kStageTripped) != 0;
  return is_of_stage ? StopMode::kCoast : StopMode::kConfigured;
}

/// A brake that lasts has to outlive a reset.
template <typename Begin>
void Robot::change_action(Begin begin) {
  const bool held = stop_action_.holds();
  begin();
  if (stop_action_.holds() != held) note_latches();
}

/// In each state but BOOT, when nothing was driven and no parameter is loaded.
void Robot::begin_action(StopMode mode, bool may_weaken, uint64_t now_us) {
  if (supervisor_.state() == SupervisorState::kBoot) return;
  if (mode == StopMode::kConfigured) mode = config_.stop_mode;
  change_action([&] { stop_action_.begin(mode, may_weaken, now_us, config_.brake_time_us); });
}

// --- setpoints -----------------------------------------------------------------------------------

RefusalCode Robot::obey(const Setpoint& setpoint, uint64_t now_us) {
  if (has_passed(setpoint.expiry_us, now_us)) return RefusalCode::kExpired;
  if (trial_.refusal() != RefusalCode::kNone) return trial_.refusal();
  const RefusalCode refusal = setpoint_refusal(supervisor_.state());
  if (refusal != RefusalCode::kNone) return refusal;
  // One condition for these and the sensors, because each setpoint takes this path.
  if ((contradictions_ | (reflexes_ & (reflex::kUnread | reflex::kStop))) != 0)
    return standing_refusal(setpoint, now_us);
  if (unarmed_ != 0 && !arm(setpoint, now_us)) return RefusalCode::kUnarmed;
  setpoint_ = {
      .mode = setpoint.mode,
      .wheels = setpoint.wheels,
      .expiry_us = deadline_of(setpoint.expiry_us, now_us, config_.ttl_max_us),
      .command_seq = setpoint.command_seq,
  };
  target_ = limited(setpoint);
  if (!moves_) begin_motion();
  if (!supervisor_.may_drive()) apply(SupervisorEvent::kSetpoint, now_us);
  return RefusalCode::kNone;
}

RefusalCode Robot::standing_refusal(const Setpoint& setpoint, uint64_t now_us) {
  if (contradictions_ != 0) return RefusalCode::kContradiction;
  if ((reflexes_ & reflex::kUnread) != 0) return RefusalCode::kBooting;
  // One that is to stand does not try to drive: opening a link sends a zero.
  if (!setpoint.wheels.is_zero()) trip(fault::kExternal, now_us);
  return RefusalCode::kFault;
}

/// Whether the robot obeys the setpoint although it is unarmed. Motion must not restart because of
/// a clear alone, a start (ISO 13850), or a bumper that is free again. So a program that keeps
/// sending must first ask for standstill, pause, or drive away from the bumper.
bool Robot::arm(const Setpoint& setpoint, uint64_t now_us) {
  const bool is_away = (unarmed_ & kUnarmed) == 0 && !forbids(unarmed_, setpoint.wheels);
  if (setpoint.wheels.is_zero() || is_away || now_us - quiet_since_us_ >= config_.rearm_gap_us) {
    unarmed_ = 0;
    note_forbidden();
    return true;
  }
  // An open bumper holds it off, as it did before.
  is_refused_ = true;
  const bool is_held = (unarmed_ & kUnarmed) == 0 && forbids(reflexes_, setpoint.wheels);
  if (is_held) quiet_since_us_ = now_us;
  return is_held;
}

void Robot::disarm(uint8_t unarmed, uint64_t now_us) {
  unarmed_ |= unarmed;
  is_refused_ = unarmed != kUnarmed;  // A bumper has held one off.
  note_forbidden();
  quiet_since_us_ = now_us;
}

/// The previous values first: they decide how the robot stops.
void Robot::end_session(SupervisorEvent event, StopCause cause, uint64_t now_us) {
  if (trial_.runs()) {
    parameters_ = trial_.former();
    apply_parameters();
  }
  trial_.end();
  rolling_.reset();  // A new host has not heard of it.
  if (event == SupervisorEvent::kSession) quiet_since_us_ = now_us;
  is_refused_ = false;
  begin_action(StopMode::kConfigured, false, now_us);
  apply(event, now_us, cause);
  setpoint_ = {};
}

WheelPair Robot::limited(const Setpoint& setpoint) const {
  int32_t limit =
      setpoint.mode == ControlMode::kVelocity ? config_.max_velocity_umps : config_.gains.limit_q15;
  if ((reflexes_ & reflex::kLimit) != 0) limit /= 2;
  return scale_to_limit(setpoint.wheels, limit);
}

// --- clearing ------------------------------------------------------------------------------------

RefusalCode Robot::clear_estop(uint64_t now_us) {
  if (contact_is_open()) return RefusalCode::kCausePresent;
  contact_open_ = false;  // If it is still open in the next step, it latches again.
  if (supervisor_.state() != SupervisorState::kEstopped) return RefusalCode::kNone;
  disarm(kUnarmed, now_us);
  estop_source_ = EstopSource::kNone;
  apply(SupervisorEvent::kClearEstop, now_us);
  trip(0, now_us);  // A fault that the e-stop hid is active again.
  sync_latches(false, now_us);
  return RefusalCode::kNone;
}

RefusalCode Robot::clear_fault(uint64_t now_us) {
  // Before the sensors were read, it is also unknown whether the cause is gone.
  const bool lasts =
      (faults_ & fault::kExternal) != 0 && (reflexes_ & (reflex::kStop | reflex::kUnread)) != 0;
  if (lasts || lasting_faults() != 0) return RefusalCode::kCausePresent;
  if (supervisor_.state() == SupervisorState::kFault) disarm(kUnarmed, now_us);
  if (faults_ != 0) drive_.end_evidence();
  faults_ = 0;
  apply(SupervisorEvent::kClearFault, now_us);
  note_latches();  // Also where an e-stop hides the state FAULT.
  return RefusalCode::kNone;
}

// --- parameters ----------------------------------------------------------------------------------

/// While driving only at the beginning of a control step, so that a whole step works with the same
/// configuration.
void Robot::apply_parameters() {
  parameters_changed_ = false;
  config_ = make_config(parameters_);
  contradictions_ = contradictions(parameters_, board_.max_pwm_hz);
  if (recorder_ != nullptr) recorder_->note_parameters(parameters_, config_, contradictions_);
  drive_.note_parameters(config_);
  target_ = limited(setpoint_);
}

RefusalCode Robot::set_parameter(ParameterId id, float value, uint64_t now_us) {
  RefusalCode refusal = parameters_.check(id, value);
  if (refusal != RefusalCode::kNone || value == parameters_.get(id)) return refusal;
  refusal = parameters_.spec(id).changes == ParameterChanges::kReleased ? trial_.lasting_refusal()
                                                                        : trial_.refusal();
  if (refusal != RefusalCode::kNone) return refusal;
  check_contact(now_us);  // It may have opened since the last control step.
  refusal = change_refusal(supervisor_.state(), turns(), parameters_.spec(id).changes);
  if (refusal != RefusalCode::kNone) return refusal;
  // On trial the order of several values must not matter: they are judged together, by KEEP. What
  // the robot is driving with is judged at once.
  Parameters changed = parameters_;
  changed.set(id, value);
  const uint32_t contradicting = contradictions(changed, board_.max_pwm_hz) & ~contradictions_;
  if (contradicting != 0 && (!trial_.runs() || supervisor_.may_drive())) {
    refused_contradictions_ = contradicting;
    return RefusalCode::kContradiction;
  }
  parameters_.set(id, value);
  parameters_changed_ = true;
  if (!supervisor_.may_drive()) apply_parameters();
  return RefusalCode::kNone;
}

RefusalCode Robot::save_parameters(ParameterId id) {
  const bool all = id == kAllParameters;
  if (!all && !Parameters::exists(id)) return RefusalCode::kUnknownParameter;
  const RefusalCode refusal = check_stopped();
  if (refusal != RefusalCode::kNone) return refusal;
  return conclude_save(all ? parameters_.save(hal_.store) : parameters_.save_one(hal_.store, id));
}

RefusalCode Robot::check_stopped() const {
  if (trial_.lasting_refusal() != RefusalCode::kNone) return trial_.lasting_refusal();
  return change_refusal(supervisor_.state(), false, ParameterChanges::kStopped);
}

RefusalCode Robot::check_estop(uint64_t now_us) {
  if (!board_.is_confirmed) return RefusalCode::kNone;
  check_contact(now_us);  // It may have opened since the last control step.
  const bool is_latched = supervisor_.state() == SupervisorState::kEstopped;
  return is_latched ? RefusalCode::kEstopped : RefusalCode::kNone;
}

RefusalCode Robot::conclude_save(bool saved) {
  note_write(saved);
  store_state_ = Parameters::Load::kLoaded;  // Part of a failed save may be left.
  if (!saved) return RefusalCode::kStoreFailed;
  store_faults_ = 0;
  return RefusalCode::kNone;
}

RefusalCode Robot::reset_parameters(uint64_t now_us) {
  if (trial_.lasting_refusal() != RefusalCode::kNone) return trial_.lasting_refusal();
  check_contact(now_us);  // As above: the defaults may switch the contact off.
  const RefusalCode refusal =
      change_refusal(supervisor_.state(), turns(), ParameterChanges::kReleased);
  if (refusal != RefusalCode::kNone) return refusal;
  parameters_.set_defaults();
  apply_parameters();
  if (store_state_ == Parameters::Load::kEmpty && store_faults_ == 0) return RefusalCode::kNone;
  bool saved = Parameters::save_none(hal_.store);
  // Storage that cannot be opened takes nothing before it is formatted.
  if (!saved && store_faults_ != 0)
    saved = hal_.store.format() && Parameters::save_none(hal_.store);
  const RefusalCode outcome = conclude_save(saved);
  if (saved) store_state_ = Parameters::Load::kEmpty;
  return outcome;
}

// --- a trial of parameters -----------------------------------------------------------------------

RefusalCode Robot::try_parameters(TrialAction action, float timeout_s, uint64_t now_us) {
  check_trial(now_us);  // Its deadline may have passed since the last control step.
  switch (action) {
    case TrialAction::kBegin:
      return extend_trial(true, timeout_s, now_us);
    case TrialAction::kRenew:
      return extend_trial(false, timeout_s, now_us);
    case TrialAction::kKeep:
      return keep_trial();
    case TrialAction::kRevert:
      if (trial_.runs()) end_session(SupervisorEvent::kStop, StopCause::kTrialEnded, now_us);
      trial_.end();
      return RefusalCode::kNone;
  }
  return RefusalCode::kOutOfRange;
}

RefusalCode Robot::keep_trial() {
  if (!trial_.runs()) return RefusalCode::kNoTrial;
  const uint32_t new_ones = contradictions(parameters_, board_.max_pwm_hz) &
                            ~contradictions(trial_.former(), board_.max_pwm_hz);
  if (new_ones != 0) {
    refused_contradictions_ = new_ones;
    return RefusalCode::kContradiction;
  }
  trial_.end();
  return RefusalCode::kNone;
}

RefusalCode Robot::extend_trial(bool begins, float timeout_s, uint64_t now_us) {
  if (!__builtin_isfinite(timeout_s)) return RefusalCode::kNotFinite;
  if (timeout_s < kShortestTrialS || timeout_s > kLongestTrialS) return RefusalCode::kOutOfRange;
  const uint64_t deadline_us = now_us + static_cast<uint32_t>(timeout_s * 1e6f);
  if (!begins) {
    if (!trial_.runs()) return RefusalCode::kNoTrial;
    trial_.renew(deadline_us);
    return RefusalCode::kNone;
  }
  RefusalCode refusal = trial_.lasting_refusal();
  if (refusal == RefusalCode::kNone)
    refusal = change_refusal(supervisor_.state(), turns(), ParameterChanges::kAlways);
  if (refusal == RefusalCode::kNone) trial_.begin(parameters_, deadline_us);
  return refusal;
}

void Robot::check_trial(uint64_t now_us) {
  if (!trial_.is_due(now_us)) return;
  end_session(SupervisorEvent::kStop, StopCause::kTrialEnded, now_us);
  trial_.expire();
  observer_.on_trial_expired(now_us);
}

}  // namespace wheelwire
