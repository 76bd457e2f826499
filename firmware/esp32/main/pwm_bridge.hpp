// The pins of the L298N: IN by level, EN by the motor-control PWM (MCPWM).
#pragma once

#include "board/board.hpp"
#include "driver/mcpwm_prelude.h"
#include "hal.hpp"

namespace wheelwire {

/// One timer for both bridges: they have the same frequency and are in phase.
class PwmTimer {
 public:
  bool create(uint32_t frequency_hz);
  /// Call after both bridges have started: creating a PWM output routes EN to it, and EN must not
  /// rise then.
  bool run();
  mcpwm_timer_handle_t handle() const { return timer_; }
  uint32_t period_ticks() const { return period_ticks_; }

 private:
  mcpwm_timer_handle_t timer_ = nullptr;
  uint32_t period_ticks_ = 0;
};

/// EN is routed to the PWM only while a drive is wanted, and is a plain low output otherwise, not a
/// PWM of 0 %: so EN that the dead-man pulled low stays low until a control step drives again.
class PwmBridge final : public BridgePort {
 public:
  explicit PwmBridge(const BridgePins& pins) : pins_(pins) {}

  bool start(const PwmTimer& timer);

  void set_inputs(bool in1, bool in2) override;
  void set_enable(uint16_t duty_q15) override;

 private:
  bool start_pwm(mcpwm_timer_handle_t timer);

  BridgePins pins_;
  uint32_t period_ticks_ = 0;
  mcpwm_cmpr_handle_t comparator_ = nullptr;
  uint32_t pwm_route_ = 0;  ///< Signal in the GPIO matrix while EN follows the PWM; 0: not started.
};

}  // namespace wheelwire
