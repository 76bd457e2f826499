#include "stage_pins.hpp"

#include <algorithm>

#include "brake_hold.hpp"
#include "clock.hpp"
#include "gpio_pin.hpp"
#include "moving_wheels.hpp"
#include "release_pins.hpp"

namespace wheelwire {
namespace {

constexpr int kGroup = 0;
// 80 MHz gives 4000 steps at 20 kHz, but overflows the 16-bit counter below 1.2 kHz; there 5 MHz is
// used.
constexpr uint32_t kFineHz = 80'000'000;
constexpr uint32_t kCoarseHz = 5'000'000;
constexpr uint32_t kCounterEnd = 65'535;

uint32_t resolution_for(uint32_t frequency_hz) {
  return kFineHz / frequency_hz <= kCounterEnd ? kFineHz : kCoarseHz;
}

/// Never 0 or the whole period: those are constant levels, and a small duty must not vanish. (32
/// 767 steps of a duty fall on 4000 ticks at 20 kHz.)
uint32_t ticks_of(uint16_t duty_q15, uint32_t period_ticks) {
  return std::clamp(duty_q15 * period_ticks / INT16_MAX, uint32_t{1}, period_ticks - 1);
}

/// Whether an input of the stage ever takes a duty.
bool takes_pwm(const StageTable& stage, size_t input) {
  for (const auto& row : stage.rows)
    if (row[input] == StageLevel::kPwm) return true;
  return false;
}

}  // namespace

bool PwmTimer::create(uint32_t frequency_hz) {
  const uint32_t resolution_hz = resolution_for(frequency_hz);
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

bool PwmTimer::run() {
  return mcpwm_timer_enable(timer_) == ESP_OK &&
         mcpwm_timer_start_stop(timer_, MCPWM_TIMER_START_NO_STOP) == ESP_OK;
}

bool StagePins::start(const PwmTimer& timer, const BoardDescription& board, size_t wheel) {
  const StageTable& stage = *table_of(board.stage);
  stage_ = &stage;
  wheel_ = static_cast<uint32_t>(wheel);
  period_ticks_ = timer.period_ticks();
  period_us_ = timer.period_us();
  mcpwm_oper_handle_t channel = nullptr;
  const mcpwm_operator_config_t config = {.group_id = kGroup, .intr_priority = 0, .flags = {}};
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

bool StagePins::start_pwm(mcpwm_oper_handle_t channel, Input& input) {
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

void StagePins::set(const StageOutputs& outputs) {
  if (!started_) return;  // All inputs stay low.
  const bool still = stands_still(*stage_, outputs);
  if (!still) note_moving(wheel_);
  if (standby_ >= 0) gpio_set_level(static_cast<gpio_num_t>(standby_), 1);
  for_each_input(outputs_, outputs, [this](StageInput input, uint16_t duty_q15) {
    set_input(inputs_[static_cast<size_t>(input)], duty_q15);
  });
  outputs_ = outputs;
  if (still) note_still(wheel_);
}

void StagePins::set_input(Input& input, uint16_t duty_q15) {
  if (input.pin < 0) return;
  if (input.comparator != nullptr) {
    set_pwm_input(input, duty_q15);
  } else {
    gpio_set_level(static_cast<gpio_num_t>(input.pin), duty_q15 != 0);
  }
}

void StagePins::set_pwm_input(Input& input, uint16_t duty_q15) {
  const auto pin = static_cast<gpio_num_t>(input.pin);
  const uint32_t route = output_route_register(input.pin);
  const bool was_wanted = input.duty_q15 != 0;
  input.duty_q15 = duty_q15;
  if (duty_q15 == 0 || duty_q15 == kHigh_q15) {
    // The level first: the pin must not show another one when it leaves the PWM.
    gpio_set_level(pin, duty_q15 != 0);
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
  gpio_set_level(pin, 0);
  input.is_low = false;
}

}  // namespace wheelwire
