#include "pwm_bridge.hpp"

#include "driver/gpio.h"
#include "enable_pins.hpp"

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

void set_output(int pin, bool level) { gpio_set_level(static_cast<gpio_num_t>(pin), level); }

bool make_outputs(int in1, int in2) {
  set_output(in1, false);
  set_output(in2, false);
  const gpio_config_t config = {
      .pin_bit_mask = mask_of(in1) | mask_of(in2),
      .mode = GPIO_MODE_OUTPUT,
      .pull_up_en = GPIO_PULLUP_DISABLE,
      .pull_down_en = GPIO_PULLDOWN_DISABLE,
      .intr_type = GPIO_INTR_DISABLE,
  };
  return gpio_config(&config) == ESP_OK;
}

}  // namespace

bool PwmTimer::create(uint32_t frequency_hz) {
  const uint32_t resolution_hz = resolution_for(frequency_hz);
  period_ticks_ = resolution_hz / frequency_hz;
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

bool PwmBridge::start(const PwmTimer& timer) {
  period_ticks_ = timer.period_ticks();
  const bool started = make_outputs(pins_.in1, pins_.in2) && start_pwm(timer.handle());
  // The driver has routed EN to its output: noted for later, and taken back.
  if (started) pwm_route_ = REG_READ(output_route_register(pins_.enable));
  hold_enables_low();
  return started;
}

bool PwmBridge::start_pwm(mcpwm_timer_handle_t timer) {
  mcpwm_oper_handle_t channel = nullptr;
  const mcpwm_operator_config_t operator_config = {
      .group_id = kGroup, .intr_priority = 0, .flags = {}};
  if (mcpwm_new_operator(&operator_config, &channel) != ESP_OK ||
      mcpwm_operator_connect_timer(channel, timer) != ESP_OK)
    return false;

  mcpwm_comparator_config_t comparator_config = {};
  comparator_config.flags.update_cmp_on_tez = true;  // A period keeps the duty it began with.
  if (mcpwm_new_comparator(channel, &comparator_config, &comparator_) != ESP_OK ||
      mcpwm_comparator_set_compare_value(comparator_, 0) != ESP_OK)
    return false;

  mcpwm_gen_handle_t output = nullptr;
  const mcpwm_generator_config_t generator_config = {.gen_gpio_num = pins_.enable, .flags = {}};
  if (mcpwm_new_generator(channel, &generator_config, &output) != ESP_OK) return false;
  const mcpwm_gen_timer_event_action_t rise = {
      .direction = MCPWM_TIMER_DIRECTION_UP,
      .event = MCPWM_TIMER_EVENT_EMPTY,
      .action = MCPWM_GEN_ACTION_HIGH,
  };
  const mcpwm_gen_compare_event_action_t fall = {
      .direction = MCPWM_TIMER_DIRECTION_UP,
      .comparator = comparator_,
      .action = MCPWM_GEN_ACTION_LOW,
  };
  // The falling edge first: an output with only a rising one would stay high.
  return mcpwm_generator_set_action_on_compare_event(output, fall) == ESP_OK &&
         mcpwm_generator_set_action_on_timer_event(output, rise) == ESP_OK;
}

void PwmBridge::set_inputs(bool in1, bool in2) {
  set_output(pins_.in1, in1);
  set_output(pins_.in2, in2);
}

void PwmBridge::set_enable(uint16_t duty_q15) {
  if (pwm_route_ == 0) return;  // Not started: EN stays low.
  // At full duty the counter never reaches the comparator, and EN stays high.
  mcpwm_comparator_set_compare_value(comparator_, duty_q15 * period_ticks_ / INT16_MAX);
  REG_WRITE(output_route_register(pins_.enable), duty_q15 == 0 ? SIG_GPIO_OUT_IDX : pwm_route_);
}

}  // namespace wheelwire
