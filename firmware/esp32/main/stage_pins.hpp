// The inputs of one wheel's power stage on the chip's pins: by level, or by the motor-control PWM
// (MCPWM) where the stage takes a duty.
#pragma once

#include "board_rules.hpp"
#include "driver/mcpwm_prelude.h"
#include "hal.hpp"

namespace wheelwire {

/// One timer for both wheels: they have the same frequency and are in phase.
class PwmTimer {
 public:
  bool create(uint32_t frequency_hz);
  /// Call after both wheels have started: creating a PWM output routes a pin to it, and the pin
  /// must not rise then.
  bool run();
  mcpwm_timer_handle_t handle() const { return timer_; }
  uint32_t period_ticks() const { return period_ticks_; }
  /// Rounded up.
  uint32_t period_us() const { return period_us_; }

 private:
  mcpwm_timer_handle_t timer_ = nullptr;
  uint32_t period_ticks_ = 0;
  uint32_t period_us_ = 0;
};

/// A pin is routed to the PWM only while a duty between low and high is wanted, and is a plain
/// output otherwise, not a PWM of 0 or 100 %. So low and high act at once, although the PWM takes a
/// new duty at the start of its period only; and a pin that the dead-man pulled low stays low until
/// a control step drives again.
///
/// From low, a pin is routed to the PWM once a period has begun since it went low. Until then the
/// PWM still has the duty of before, which may belong to the other direction: with a PWM slower
/// than the control steps, a reversal waits for at most one period more.
class StagePins final : public StagePort {
 public:
  bool start(const PwmTimer& timer, const BoardDescription& board, size_t wheel);

  void set(const StageOutputs& outputs) override;

 private:
  struct Input {
    int pin = -1;
    mcpwm_cmpr_handle_t comparator = nullptr;  ///< nullptr: by level.
    uint32_t pwm_route = 0;     ///< Signal in the GPIO matrix while it follows the PWM.
    uint16_t duty_q15 = 0;      ///< What is wanted.
    bool is_low = true;         ///< Low is wanted, or the PWM does not have the duty yet.
    uint64_t low_since_us = 0;  ///< Since when the PWM has low for its next period.
  };

  static bool start_pwm(mcpwm_oper_handle_t channel, Input& input);
  void set_input(Input& input, uint16_t duty_q15);
  void set_pwm_input(Input& input, uint16_t duty_q15);

  const StageTable* stage_ = nullptr;
  uint32_t wheel_ = 0;
  Input inputs_[kStageInputs];
  int standby_ = -1;
  StageOutputs outputs_;
  uint32_t period_ticks_ = 0;
  uint32_t period_us_ = 0;
  bool started_ = false;
};

}  // namespace wheelwire
