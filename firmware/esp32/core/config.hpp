// The parameters in the form that the control loop uses: integers, scaled once when one changes.
#pragma once

#include "controller.hpp"
#include "fault_monitor.hpp"
#include "parameters.hpp"
#include "path.hpp"
#include "plausibility.hpp"

namespace wheelwire {

struct ControlConfig {
  uint32_t period_us;
  int32_t um_per_tick_q10;
  uint32_t velocity_window_us;
  ControllerGains gains;
  PathGains path;
  FaultThresholds faults;
  uint32_t plausibility_time_us;
  Supply supply;
  int32_t max_velocity_umps;
  int32_t velocity_slew_umps;  ///< Per control step.
  int32_t duty_slew_q15;       ///< Per control step.
  bool left_motor_inverted;
  bool right_motor_inverted;
  bool left_encoder_inverted;
  bool right_encoder_inverted;
  bool motors_swapped;
  bool encoders_swapped;
  StopMode stop_mode;
  StopMode estop_mode;
  uint32_t brake_time_us;
  uint32_t ttl_max_us;
  uint32_t rearm_gap_us;  ///< Not shorter than ttl_max_us.
  int32_t rolling_umps;
  uint32_t overrun_limit_us;
  bool estop_input_enabled;

  template <typename Visitor>
  void visit(Visitor& visit) {
    visit("period_us", period_us);
    visit("um_per_tick_q10", um_per_tick_q10);
    visit("velocity_window_us", velocity_window_us);
    visit("gains", gains);
    visit("path", path);
    visit("faults", faults);
    visit("plausibility_time_us", plausibility_time_us);
    visit("supply", supply);
    visit("max_velocity_umps", max_velocity_umps);
    visit("velocity_slew_umps", velocity_slew_umps);
    visit("duty_slew_q15", duty_slew_q15);
    visit("left_motor_inverted", left_motor_inverted);
    visit("right_motor_inverted", right_motor_inverted);
    visit("left_encoder_inverted", left_encoder_inverted);
    visit("right_encoder_inverted", right_encoder_inverted);
    visit("motors_swapped", motors_swapped);
    visit("encoders_swapped", encoders_swapped);
    visit("stop_mode", stop_mode);
    visit("estop_mode", estop_mode);
    visit("brake_time_us", brake_time_us);
    visit("ttl_max_us", ttl_max_us);
    visit("rearm_gap_us", rearm_gap_us);
    visit("rolling_umps", rolling_umps);
    visit("overrun_limit_us", overrun_limit_us);
    visit("estop_input_enabled", estop_input_enabled);
  }
};

ControlConfig make_config(const Parameters& parameters);

}  // namespace wheelwire
