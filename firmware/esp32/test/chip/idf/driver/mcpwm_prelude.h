// The PWM as its driver sets it up, with one timer. It refuses what ESP-IDF's refuses.
#pragma once

#include "driver/mcpwm_cap.h"
#include "esp_err.h"
#include "gpio_matrix.hpp"

using mcpwm_timer_handle_t = FakePwmTimer*;
/// An operator's newest output.
using mcpwm_oper_handle_t = FakeMatrix::Output**;
using mcpwm_cmpr_handle_t = FakeMatrix::Output*;
using mcpwm_gen_handle_t = FakeMatrix::Output*;

enum mcpwm_clock_t { MCPWM_TIMER_CLK_SRC_DEFAULT };
enum mcpwm_count_t { MCPWM_TIMER_COUNT_MODE_UP };
enum mcpwm_start_t { MCPWM_TIMER_START_NO_STOP };
enum mcpwm_direction_t { MCPWM_TIMER_DIRECTION_UP };
enum mcpwm_event_t { MCPWM_TIMER_EVENT_EMPTY };
enum mcpwm_action_t { MCPWM_GEN_ACTION_LOW, MCPWM_GEN_ACTION_HIGH };
struct mcpwm_flags_t {
  uint32_t update_cmp_on_tez;
};

struct mcpwm_timer_config_t {
  int group_id;
  mcpwm_clock_t clk_src;
  uint32_t resolution_hz;
  mcpwm_count_t count_mode;
  uint32_t period_ticks;
  int intr_priority;
  mcpwm_flags_t flags;
};
struct mcpwm_operator_config_t {
  int group_id;
  int intr_priority;
  mcpwm_flags_t flags;
};
struct mcpwm_comparator_config_t {
  mcpwm_flags_t flags;
};
struct mcpwm_generator_config_t {
  int gen_gpio_num;
  mcpwm_flags_t flags;
};
struct mcpwm_gen_timer_event_action_t {
  mcpwm_direction_t direction;
  mcpwm_event_t event;
  mcpwm_action_t action;
};
struct mcpwm_gen_compare_event_action_t {
  mcpwm_direction_t direction;
  mcpwm_cmpr_handle_t comparator;
  mcpwm_action_t action;
};

/// Each comparator is followed by its generator: together they are an output.
inline esp_err_t mcpwm_new_timer(const mcpwm_timer_config_t* config, mcpwm_timer_handle_t* timer) {
  constexpr uint32_t kMaxPeriodTicks = 65'535;
  if (config->period_ticks == 0 || config->period_ticks > kMaxPeriodTicks) return ESP_FAIL;
  fake_matrix.pwm = {.resolution_hz = config->resolution_hz, .period_ticks = config->period_ticks};
  *timer = &fake_matrix.pwm;
  return ESP_OK;
}
inline esp_err_t mcpwm_timer_enable(mcpwm_timer_handle_t timer) {
  timer->is_enabled = true;
  return ESP_OK;
}
inline esp_err_t mcpwm_timer_start_stop(mcpwm_timer_handle_t timer, mcpwm_start_t) {
  if (!timer->is_enabled) return ESP_FAIL;
  timer->start_us = fake_time_us;
  timer->runs = true;
  fake_matrix.look();
  return ESP_OK;
}
inline esp_err_t mcpwm_new_operator(const mcpwm_operator_config_t*, mcpwm_oper_handle_t* channel) {
  static FakeMatrix::Output* newest[16];
  static int count = 0;
  *channel = &newest[count++ % 16];
  return ESP_OK;
}
inline esp_err_t mcpwm_operator_connect_timer(mcpwm_oper_handle_t, mcpwm_timer_handle_t) {
  return ESP_OK;
}
inline esp_err_t mcpwm_new_comparator(mcpwm_oper_handle_t channel,
                                      const mcpwm_comparator_config_t* config,
                                      mcpwm_cmpr_handle_t* comparator) {
  const auto signal = static_cast<uint32_t>(kFirstPwmSignal + fake_matrix.outputs.size());
  *channel = &fake_matrix.outputs[signal];
  (*channel)->signal = signal;
  (*channel)->timer = &fake_matrix.pwm;
  (*channel)->loads_at_start = config->flags.update_cmp_on_tez != 0;
  *comparator = *channel;
  return ESP_OK;
}
inline esp_err_t mcpwm_comparator_set_compare_value(mcpwm_cmpr_handle_t comparator,
                                                    uint32_t ticks) {
  if (ticks > comparator->timer->period_ticks) return ESP_FAIL;
  comparator->write(ticks, 1000 * fake_time_us);
  fake_matrix.look();
  return ESP_OK;
}
inline esp_err_t mcpwm_new_generator(mcpwm_oper_handle_t channel,
                                     const mcpwm_generator_config_t* config,
                                     mcpwm_gen_handle_t* output) {
  *output = *channel;
  fake_matrix.enabled[config->gen_gpio_num] = true;
  fake_matrix.write(GPIO_FUNC0_OUT_SEL_CFG_REG + 4 * static_cast<uint32_t>(config->gen_gpio_num),
                    (*channel)->signal);
  return ESP_OK;
}
inline esp_err_t mcpwm_generator_set_action_on_timer_event(mcpwm_gen_handle_t output,
                                                           mcpwm_gen_timer_event_action_t) {
  output->rises = true;
  fake_matrix.look();
  return ESP_OK;
}
inline esp_err_t mcpwm_generator_set_action_on_compare_event(mcpwm_gen_handle_t output,
                                                             mcpwm_gen_compare_event_action_t) {
  output->falls = true;
  fake_matrix.look();
  return ESP_OK;
}
