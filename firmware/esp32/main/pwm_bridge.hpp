// The pins of the L298N: IN by level, EN by the motor-control PWM (MCPWM).
#pragma once

#include "board/board.hpp"
#include "driver/mcpwm_prelude.h"
#include "hal.hpp"

namespace wheelwire {

/// Both bridges run on one timer, and so at one frequency and in phase.
class PwmTimer {
 public:
  bool create(uint32_t frequency_hz);
  /// Once the bridges are started: making an output routes EN to it, which must not rise there.
  bool run();
  mcpwm_timer_handle_t handle() const { return timer_; }
  uint32_t period_ticks() const { return period_ticks_; }

 private:
  mcpwm_timer_handle_t timer_ = nullptr;
  uint32_t period_ticks_ = 0;
};

/// EN is routed to the PWM only while it is to be high: low is a plain output, not a PWM of 0 %,
/// and the dead-man's low lasts until a control step asks for more.
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
  uint32_t pwm_route_ = 0;  ///< In the GPIO matrix while EN follows the PWM; 0: not started.
};

}  // namespace wheelwire
