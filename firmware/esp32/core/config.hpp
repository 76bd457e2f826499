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
};

ControlConfig make_config(const Parameters& parameters);

}  // namespace wheelwire
