// The core's state as numbers, field by field: never as an image of memory, which no other build
// could read. This list is of what decides what later steps do; the core knows nothing of it.
#pragma once

#include <stdint.h>

#include "device.hpp"

namespace wheelwire {
// In an unnamed namespace, so that each including file may instantiate its own `Fields`.
namespace {

template <typename Visitor, typename T>
void walk(Visitor& visitor, T& value);

/// The fields of a class, in an explicit instantiation: only there may private ones be named.
template <typename Class, auto... kMembers>
struct Fields {
  template <typename Visitor>
  static void visit(Visitor& visitor, Class& object) {
    (visit_one<kMembers>(visitor, object), ...);
  }
  friend constexpr auto fields_of(Class*) { return Fields{}; }

 private:
  template <auto kMember, typename Visitor>
  static void visit_one(Visitor& visitor, Class& object) {
    visitor.template enter<kMember>();
    if (is_state(object, object.*kMember)) walk(visitor, object.*kMember);
    visitor.leave();
  }
  template <typename T>
  static constexpr bool is_state(const Class&, const T&) {
    return true;
  }
  /// What a trial replaced, as long as it runs.
  static bool is_state(const Trial& trial, const Parameters&) { return trial.runs(); }
};

#define WHEELWIRE_FIELDS(Class, ...) \
  constexpr auto fields_of(Class*);  \
  template struct Fields<Class, __VA_ARGS__>

// --- parameters and configuration ----------------------------------------------------------------

WHEELWIRE_FIELDS(ControllerGains, &ControllerGains::proportional_q24,
                 &ControllerGains::integral_q32, &ControllerGains::feedforward_q24,
                 &ControllerGains::acceleration_q24, &ControllerGains::delay_steps,
                 &ControllerGains::static_q15, &ControllerGains::margin_q15,
                 &ControllerGains::limit_q15, &ControllerGains::slew_umps,
                 &ControllerGains::memory_shift);
WHEELWIRE_FIELDS(PathGains, &PathGains::path_q16, &PathGains::heading_q16, &PathGains::catch_up_q15,
                 &PathGains::limit_um);
WHEELWIRE_FIELDS(FaultThresholds, &FaultThresholds::stall_duty_q15, &FaultThresholds::stall_time_us,
                 &FaultThresholds::reversal_duty_q15, &FaultThresholds::reversal_umps);
WHEELWIRE_FIELDS(Supply, &Supply::nominal_mv, &Supply::drop_mv, &Supply::unmeasured_mv);
WHEELWIRE_FIELDS(ControlConfig, &ControlConfig::period_us, &ControlConfig::um_per_tick_q10,
                 &ControlConfig::velocity_window_us, &ControlConfig::gains, &ControlConfig::path,
                 &ControlConfig::faults, &ControlConfig::plausibility_time_us,
                 &ControlConfig::supply, &ControlConfig::max_velocity_umps,
                 &ControlConfig::velocity_slew_umps, &ControlConfig::duty_slew_q15,
                 &ControlConfig::left_motor_inverted, &ControlConfig::right_motor_inverted,
                 &ControlConfig::left_encoder_inverted, &ControlConfig::right_encoder_inverted,
                 &ControlConfig::motors_swapped, &ControlConfig::encoders_swapped,
                 &ControlConfig::stop_mode, &ControlConfig::estop_mode,
                 &ControlConfig::brake_time_us, &ControlConfig::ttl_max_us,
                 &ControlConfig::rearm_gap_us, &ControlConfig::rolling_umps,
                 &ControlConfig::overrun_limit_us, &ControlConfig::estop_input_enabled);
WHEELWIRE_FIELDS(Parameters, &Parameters::values_);
WHEELWIRE_FIELDS(Trial, &Trial::state_, &Trial::deadline_us_, &Trial::former_);
WHEELWIRE_FIELDS(ActiveConfiguration, &ActiveConfiguration::chip_, &ActiveConfiguration::store_,
                 &ActiveConfiguration::state_, &ActiveConfiguration::is_fresh_,
                 &ActiveConfiguration::fingerprint_, &ActiveConfiguration::staged_);

// --- a wheel -------------------------------------------------------------------------------------

WHEELWIRE_FIELDS(Evidence, &Evidence::us_, &Evidence::calm_us_);
WHEELWIRE_FIELDS(TickTotal, &TickTotal::counter_, &TickTotal::ticks_);
WHEELWIRE_FIELDS(VelocityEstimator::Tick, &VelocityEstimator::Tick::ticks,
                 &VelocityEstimator::Tick::t_us, &VelocityEstimator::Tick::behind_q4);
WHEELWIRE_FIELDS(VelocityEstimator::Mark, &VelocityEstimator::Mark::newest,
                 &VelocityEstimator::Mark::noted_us);
WHEELWIRE_FIELDS(VelocityEstimator, &VelocityEstimator::direction_, &VelocityEstimator::spacing_us_,
                 &VelocityEstimator::dither_q16_, &VelocityEstimator::cycle_us_,
                 &VelocityEstimator::silence_us_, &VelocityEstimator::newest_,
                 &VelocityEstimator::baseline_, &VelocityEstimator::rate_q8_,
                 &VelocityEstimator::falling_behind_umps_, &VelocityEstimator::marks_);
WHEELWIRE_FIELDS(ObstacleMemory, &ObstacleMemory::held_, &ObstacleMemory::rolled_steps_,
                 &ObstacleMemory::gain_umps_, &ObstacleMemory::rolling_q32_);
WHEELWIRE_FIELDS(Controller, &Controller::last_target_umps_, &Controller::steady_limit_q15_,
                 &Controller::integral_q32_, &Controller::saturated_, &Controller::obstacle_);
WHEELWIRE_FIELDS(FaultMonitor, &FaultMonitor::anchor_ticks_, &FaultMonitor::still_,
                 &FaultMonitor::against_, &FaultMonitor::lowest_umps_, &FaultMonitor::opposed_);
WHEELWIRE_FIELDS(FollowingError, &FollowingError::total_q10_, &FollowingError::at_tick_q10_,
                 &FollowingError::trimmed_q10_, &FollowingError::held_um_,
                 &FollowingError::setpoint_umps_, &FollowingError::direction_,
                 &FollowingError::following_, &FollowingError::now_us_, &FollowingError::tick_us_);
WHEELWIRE_FIELDS(PlausibilityMonitor, &PlausibilityMonitor::slow_umps_q4_,
                 &PlausibilityMonitor::silence_us_, &PlausibilityMonitor::excess_,
                 &PlausibilityMonitor::earlier_q4_, &PlausibilityMonitor::impulse_q15_);
WHEELWIRE_FIELDS(Wheel, &Wheel::total_, &Wheel::estimator_, &Wheel::controller_, &Wheel::monitor_,
                 &Wheel::following_, &Wheel::plausibility_, &Wheel::closed_loop_, &Wheel::reverses_,
                 &Wheel::yields_, &Wheel::brakes_, &Wheel::direction_, &Wheel::velocity_umps_,
                 &Wheel::duty_q15_);

// --- the robot -----------------------------------------------------------------------------------

WHEELWIRE_FIELDS(WheelPair, &WheelPair::left, &WheelPair::right);
WHEELWIRE_FIELDS(OverspeedMonitor, &OverspeedMonitor::excess_);
// Which motor belongs to which wheel is not state: a re-run has no motors.
WHEELWIRE_FIELDS(Drive, &Drive::left_, &Drive::right_, &Drive::overspeed_, &Drive::motors_swapped_,
                 &Drive::encoders_swapped_, &Drive::mode_, &Drive::following_, &Drive::reflexes_,
                 &Drive::slewed_, &Drive::command_, &Drive::direction_, &Drive::battery_mv_,
                 &Drive::supply_q12_, &Drive::stop_began_);
WHEELWIRE_FIELDS(BoardFacts, &BoardFacts::checksum, &BoardFacts::max_pwm_hz,
                 &BoardFacts::is_confirmed, &BoardFacts::on_trial);
WHEELWIRE_FIELDS(Supervisor, &Supervisor::state_);
WHEELWIRE_FIELDS(Setpoint, &Setpoint::mode, &Setpoint::wheels, &Setpoint::expiry_us,
                 &Setpoint::command_seq);
WHEELWIRE_FIELDS(StopAction, &StopAction::mode_, &StopAction::guards_, &StopAction::until_us_);
WHEELWIRE_FIELDS(RollingMonitor, &RollingMonitor::is_fast_, &RollingMonitor::is_reported_,
                 &RollingMonitor::began_umps_, &RollingMonitor::since_us_);
WHEELWIRE_FIELDS(Latches, &Latches::estop, &Latches::holds, &Latches::battery_at_stop,
                 &Latches::faults);
WHEELWIRE_FIELDS(LatchKeeper, &LatchKeeper::latches_, &LatchKeeper::is_stored_,
                 &LatchKeeper::is_damaged_, &LatchKeeper::write_failed_,
                 &LatchKeeper::next_note_us_);
WHEELWIRE_FIELDS(Robot, &Robot::board_, &Robot::supervisor_, &Robot::parameters_changed_,
                 &Robot::unarmed_, &Robot::reflexes_, &Robot::contact_open_, &Robot::stalled_,
                 &Robot::failures_, &Robot::store_faults_, &Robot::repairs_,
                 &Robot::next_repair_us_, &Robot::faults_, &Robot::contradictions_,
                 &Robot::last_step_us_, &Robot::drove_us_, &Robot::quiet_since_us_,
                 &Robot::not_slow_us_, &Robot::bumped_until_us_, &Robot::setpoint_, &Robot::target_,
                 &Robot::stop_action_, &Robot::rolling_, &Robot::config_, &Robot::drive_,
                 &Robot::latches_, &Robot::store_state_, &Robot::parameters_, &Robot::trial_);

// --- the link ------------------------------------------------------------------------------------

WHEELWIRE_FIELDS(Identity, &Identity::boot_id, &Identity::capabilities);
WHEELWIRE_FIELDS(Answer, &Answer::request_id);
WHEELWIRE_FIELDS(Session, &Session::open_, &Session::nonce_, &Session::id_,
                 &Session::clock_synchronised_, &Session::newest_command_,
                 &Session::newest_request_, &Session::answer_count_, &Session::answers_);
WHEELWIRE_FIELDS(MessageServer, &MessageServer::identity_, &MessageServer::session_,
                 &MessageServer::restart_us_, &MessageServer::platform_, &MessageServer::archive_,
                 &MessageServer::sensors_, &MessageServer::configuration_);
WHEELWIRE_FIELDS(Device, &Device::server_, &Device::robot_);

#undef WHEELWIRE_FIELDS

// --- the way through them ------------------------------------------------------------------------

template <typename Visitor, typename T, size_t kCount>
void walk(Visitor& visitor, T (&values)[kCount]) {
  for (T& value : values) walk(visitor, value);
}

template <typename Visitor, typename T, uint32_t kCapacity>
void walk(Visitor& visitor, Ring<T, kCapacity>& ring) {
  const uint32_t size = visitor.resize(ring);
  for (uint32_t i = 0; i < size; ++i) walk(visitor, ring[i]);
}

/// Whether there is such a part, and its state if that is in the list.
template <typename Visitor, typename T>
void walk(Visitor& visitor, T*& part) {
  visitor.keep(part);
  if constexpr (requires { fields_of(part); }) {
    if (part != nullptr) walk(visitor, *part);
  }
}

template <typename Visitor, typename T>
void walk(Visitor& visitor, T& value) {
  if constexpr (requires { fields_of(&value); }) {
    fields_of(&value).visit(visitor, value);
    visitor.check(value);
  } else {
    visitor.number(value);
  }
}

}  // namespace
}  // namespace wheelwire
