// The inputs of one wheel's power stage on the chip's pins: by level, or by the motor-control PWM
// (MCPWM) where the stage takes a duty.
#pragma once

#include <algorithm>

#include "board_rules.hpp"
#include "brake_hold.hpp"
#include "clock.hpp"
#include "driver/mcpwm_prelude.h"
#include "gpio_pin.hpp"
#include "hal.hpp"
#include "moving_wheels.hpp"
#include "release_pins.hpp"

namespace wheelwire {

/// One timer for both wheels: they have the same frequency and are in phase.
class PwmTimer {
 public:
  static constexpr int kGroup = 0;

  bool create(uint32_t frequency_hz) {
    const uint32_t resolution_hz = kFineHz / frequency_hz <= kCounterEnd ? kFineHz : kCoarseHz;
    period_ticks_ = resolution_hz / frequency_hz;
    period_us_ = 1'000'000 / frequency_hz + 1;
    const mcpwm_timer_config_t config = {
        .group_id = kGroup,
        .clk_src = MCPWM_TIMER_CLK_SRC_DEFAULT,
        .resolution_hz = resolution_hz,
        .count_mode = MCPWM_TIMER_COUNT_MODE_UP,
        .period_ticks = period_ticks_,
        .intr_priority = 0,
        .flags = {},
    };
    return mcpwm_new_timer(&config, &timer_) == ESP_OK;
  }
  /// Call after both wheels have started: creating a PWM output routes a pin to it, and the pin
  /// must not rise then.
  bool run() {
    return mcpwm_timer_enable(timer_) == ESP_OK &&
           mcpwm_timer_start_stop(timer_, MCPWM_TIMER_START_NO_STOP) == ESP_OK;
  }
  mcpwm_timer_handle_t handle() const { return timer_; }
  uint32_t period_ticks() const { return period_ticks_; }
  /// Rounded up.
  uint32_t period_us() const { return period_us_; }

 private:
  // 80 MHz gives 4000 steps at 20 kHz, but overflows the 16-bit counter below 1.2 kHz; there 5 MHz
  // is used.
  static constexpr uint32_t kFineHz = 80'000'000;
  static constexpr uint32_t kCoarseHz = 5'000'000;
  static constexpr uint32_t kCounterEnd = 65'535;

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
  bool start(const PwmTimer& timer, const BoardDescription& board, size_t wheel) {
    const StageTable& stage = *table_of(board.stage);
    stage_ = &stage;
    wheel_ = static_cast<uint32_t>(wheel);
    period_ticks_ = timer.period_ticks();
    period_us_ = timer.period_us();
    mcpwm_oper_handle_t channel = nullptr;
    const mcpwm_operator_config_t config = {
        .group_id = PwmTimer::kGroup, .intr_priority = 0, .flags = {}};
    if (mcpwm_new_operator(&config, &channel) != ESP_OK ||
        mcpwm_operator_connect_timer(channel, timer.handle()) != ESP_OK)
      return false;
    standby_ = board.standby;
    bool started = standby_ < 0 || make_low_output(standby_);
    for (size_t i = 0; i < kStageInputs; ++i) {
      Input& input = inputs_[i];
      input.pin = board.pin(input_of(wheel, i));
      if (input.pin < 0) continue;
      started = make_low_output(input.pin) && started;
      if (takes_pwm(stage, i)) started = start_pwm(channel, input) && started;
    }
    started_ = started;
    return started;
  }

  void set(const StageOutputs& outputs) override {
    if (!started_) return;  // All inputs stay low.
    const bool still = stands_still(*stage_, outputs);
    if (!still) note_moving(wheel_);
    if (standby_ >= 0) set_level(standby_, true);
    for_each_input(outputs_, outputs, [this](StageInput input, uint16_t duty_q15) {
      set_input(inputs_[static_cast<size_t>(input)], duty_q15);
    });
    outputs_ = outputs;
    if (still) note_still(wheel_);
  }

 private:
  /// Never 0 or the whole period: those are constant levels, and a small duty must not vanish.
  /// (32767 steps of a duty fall on 4000 ticks at 20 kHz.)
  static uint32_t ticks_of(uint16_t duty_q15, uint32_t period_ticks) {
    return std::clamp(duty_q15 * period_ticks / INT16_MAX, uint32_t{1}, period_ticks - 1);
  }

  /// Whether an input of the stage ever takes a duty.
  static bool takes_pwm(const StageTable& stage, size_t input) {
    for (const auto& row : stage.rows)
      if (row[input] == StageLevel::kPwm) return true;
    return false;
  }

  struct Input {
    int pin = -1;
    mcpwm_cmpr_handle_t comparator = nullptr;  ///< nullptr: by level.
    uint32_t pwm_route = 0;     ///< Signal in the GPIO matrix while it follows the PWM.
    uint16_t duty_q15 = 0;      ///< What is wanted.
    bool is_low = true;         ///< Low is wanted, or the PWM does not have the duty yet.
    uint64_t low_since_us = 0;  ///< Since when the PWM has low for its next period.
  };

  static bool start_pwm(mcpwm_oper_handle_t channel, Input& input) {
    mcpwm_comparator_config_t comparator_config = {};
    comparator_config.flags.update_cmp_on_tez = true;  // A period keeps the duty it began with.
    if (mcpwm_new_comparator(channel, &comparator_config, &input.comparator) != ESP_OK ||
        mcpwm_comparator_set_compare_value(input.comparator, 0) != ESP_OK)
      return false;
    mcpwm_gen_handle_t output = nullptr;
    const mcpwm_generator_config_t generator_config = {.gen_gpio_num = input.pin, .flags = {}};
    if (mcpwm_new_generator(channel, &generator_config, &output) != ESP_OK) return false;
    const mcpwm_gen_timer_event_action_t rise = {
        .direction = MCPWM_TIMER_DIRECTION_UP,
        .event = MCPWM_TIMER_EVENT_EMPTY,
        .action = MCPWM_GEN_ACTION_HIGH,
    };
    const mcpwm_gen_compare_event_action_t fall = {
        .direction = MCPWM_TIMER_DIRECTION_UP,
        .comparator = input.comparator,
        .action = MCPWM_GEN_ACTION_LOW,
    };
    // The driver has routed the pin to its output: recorded for later, then undone.
    input.pwm_route = REG_READ(output_route_register(input.pin));
    hold_low(words_of(mask_of(input.pin)));
    // The falling edge first: an output with only a rising one would stay high.
    return mcpwm_generator_set_action_on_compare_event(output, fall) == ESP_OK &&
           mcpwm_generator_set_action_on_timer_event(output, rise) == ESP_OK;
  }
  void set_input(Input& input, uint16_t duty_q15) {
    if (input.pin < 0) return;
    if (input.comparator != nullptr) {
      set_pwm_input(input, duty_q15);
    } else {
      set_level(input.pin, duty_q15 != 0);
    }
  }
  void set_pwm_input(Input& input, uint16_t duty_q15) {
    const uint32_t route = output_route_register(input.pin);
    const bool was_wanted = input.duty_q15 != 0;
    input.duty_q15 = duty_q15;
    if (duty_q15 == 0 || duty_q15 == kHigh_q15) {
      // The level first: the pin must not show another one when it leaves the PWM.
      set_level(input.pin, duty_q15 != 0);
      REG_WRITE(route, SIG_GPIO_OUT_IDX);
      // For the time after: at full duty the counter never reaches the comparator.
      mcpwm_comparator_set_compare_value(input.comparator, duty_q15 == 0 ? 0 : period_ticks_);
      input.is_low = duty_q15 == 0;
      if (input.is_low && was_wanted) input.low_since_us = now_us();
      return;
    }
    mcpwm_comparator_set_compare_value(input.comparator, ticks_of(duty_q15, period_ticks_));
    if (input.is_low && now_us() - input.low_since_us < period_us_) return;
    REG_WRITE(route, input.pwm_route);
    set_level(input.pin, false);
    input.is_low = false;
  }

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
