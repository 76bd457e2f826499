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

/// What a visitor may leave out.
struct StateVisitor {
  template <auto kMember>
  void enter() {}
  void leave() {}
  template <typename T>
  void check(const T&) {}
};

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

// WHEELWIRE_EACH(Class, a, b) is &Class::a, &Class::b: each scan of the preprocessor adds a field,
// up to some forty.
#define WHEELWIRE_SCAN(...) WHEELWIRE_SCAN_9(WHEELWIRE_SCAN_9(WHEELWIRE_SCAN_9(__VA_ARGS__)))
#define WHEELWIRE_SCAN_9(...) WHEELWIRE_SCAN_3(WHEELWIRE_SCAN_3(WHEELWIRE_SCAN_3(__VA_ARGS__)))
#define WHEELWIRE_SCAN_3(...) WHEELWIRE_SCAN_1(WHEELWIRE_SCAN_1(WHEELWIRE_SCAN_1(__VA_ARGS__)))
#define WHEELWIRE_SCAN_1(...) __VA_ARGS__
#define WHEELWIRE_PARENTHESES ()
#define WHEELWIRE_NEXT() WHEELWIRE_EACH
#define WHEELWIRE_EACH(Class, field, ...) \
  &Class::field __VA_OPT__(, WHEELWIRE_NEXT WHEELWIRE_PARENTHESES(Class, __VA_ARGS__))

#define WHEELWIRE_FIELDS(Class, ...) \
  constexpr auto fields_of(Class*);  \
  template struct Fields<Class, WHEELWIRE_SCAN(WHEELWIRE_EACH(Class, __VA_ARGS__))>

// --- parameters and configuration ----------------------------------------------------------------

WHEELWIRE_FIELDS(ControllerGains, proportional_q24, integral_q32, feedforward_q24, acceleration_q24,
                 delay_steps, static_q15, margin_q15, limit_q15, slew_umps, memory_shift);
WHEELWIRE_FIELDS(PathGains, path_q16, heading_q16, catch_up_q15, limit_um);
WHEELWIRE_FIELDS(FaultThresholds, stall_duty_q15, stall_time_us, reversal_duty_q15, reversal_umps);
WHEELWIRE_FIELDS(Supply, nominal_mv, drop_mv, unmeasured_mv);
WHEELWIRE_FIELDS(ControlConfig, period_us, um_per_tick_q10, velocity_window_us, gains, path, faults,
                 plausibility_time_us, supply, max_velocity_umps, velocity_slew_umps, duty_slew_q15,
                 left_motor_inverted, right_motor_inverted, left_encoder_inverted,
                 right_encoder_inverted, motors_swapped, encoders_swapped, stop_mode, estop_mode,
                 brake_time_us, ttl_max_us, rearm_gap_us, rolling_umps, overrun_limit_us,
                 estop_input_enabled);
WHEELWIRE_FIELDS(Parameters, values_);
WHEELWIRE_FIELDS(Trial, state_, deadline_us_, former_);
WHEELWIRE_FIELDS(ActiveConfiguration, chip_, store_, state_, is_fresh_, fingerprint_, staged_);

// --- a wheel -------------------------------------------------------------------------------------

WHEELWIRE_FIELDS(Evidence, us_, calm_us_);
WHEELWIRE_FIELDS(TickTotal, counter_, ticks_);
WHEELWIRE_FIELDS(VelocityEstimator::Tick, ticks, t_us, behind_q4);
WHEELWIRE_FIELDS(VelocityEstimator::Mark, newest, noted_us);
WHEELWIRE_FIELDS(VelocityEstimator, direction_, spacing_us_, dither_q16_, cycle_us_, silence_us_,
                 newest_, baseline_, rate_q8_, falling_behind_umps_, marks_);
WHEELWIRE_FIELDS(ObstacleMemory, held_, rolled_steps_, gain_umps_, rolling_q32_);
WHEELWIRE_FIELDS(Controller, last_target_umps_, steady_limit_q15_, integral_q32_, saturated_,
                 obstacle_);
WHEELWIRE_FIELDS(FaultMonitor, anchor_ticks_, still_, against_, lowest_umps_, opposed_);
WHEELWIRE_FIELDS(FollowingError, total_q10_, at_tick_q10_, trimmed_q10_, held_um_, setpoint_umps_,
                 direction_, following_, now_us_, tick_us_);
WHEELWIRE_FIELDS(PlausibilityMonitor, slow_umps_q4_, silence_us_, excess_, earlier_q4_,
                 impulse_q15_);
WHEELWIRE_FIELDS(Wheel, total_, estimator_, controller_, monitor_, following_, plausibility_,
                 closed_loop_, reverses_, yields_, brakes_, direction_, velocity_umps_, duty_q15_);

// --- the robot -----------------------------------------------------------------------------------

WHEELWIRE_FIELDS(WheelPair, left, right);
WHEELWIRE_FIELDS(OverspeedMonitor, excess_);
// Which motor belongs to which wheel is not state: a re-run has no motors.
WHEELWIRE_FIELDS(Drive, left_, right_, overspeed_, motors_swapped_, encoders_swapped_, mode_,
                 following_, reflexes_, slewed_, command_, direction_, battery_mv_, supply_q12_,
                 stop_began_);
WHEELWIRE_FIELDS(BoardFacts, checksum, max_pwm_hz, is_confirmed, on_trial);
WHEELWIRE_FIELDS(Supervisor, state_);
WHEELWIRE_FIELDS(Setpoint, mode, wheels, expiry_us, command_seq);
WHEELWIRE_FIELDS(StopAction, mode_, guards_, until_us_);
WHEELWIRE_FIELDS(RollingMonitor, is_fast_, is_reported_, began_umps_, since_us_);
WHEELWIRE_FIELDS(Latches, estop, holds, battery_at_stop, faults);
WHEELWIRE_FIELDS(LatchKeeper, latches_, is_stored_, is_damaged_, write_failed_, next_note_us_);
WHEELWIRE_FIELDS(Robot, board_, supervisor_, parameters_changed_, unarmed_, reflexes_,
                 contact_open_, stalled_, failures_, store_faults_, repairs_, next_repair_us_,
                 faults_, contradictions_, last_step_us_, drove_us_, quiet_since_us_, not_slow_us_,
                 bumped_until_us_, setpoint_, target_, stop_action_, rolling_, config_, drive_,
                 latches_, store_state_, parameters_, trial_);

// --- the link ------------------------------------------------------------------------------------

WHEELWIRE_FIELDS(Identity, boot_id, capabilities);
WHEELWIRE_FIELDS(Answer, request_id);
WHEELWIRE_FIELDS(Session, open_, nonce_, id_, clock_synchronised_, newest_command_, newest_request_,
                 answer_count_, answers_);
WHEELWIRE_FIELDS(MessageServer, identity_, session_, restart_us_, platform_, archive_, sensors_,
                 configuration_);
WHEELWIRE_FIELDS(Device, server_, robot_);

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
