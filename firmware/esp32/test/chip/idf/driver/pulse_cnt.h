// The pulse counter as far as the pins go: in ESP-IDF 5.5 a new channel pulls both its pins up and
// enables their inputs, and leaves an output enabled.
#pragma once

#include "driver/gpio.h"

using pcnt_unit_handle_t = void*;
using pcnt_channel_handle_t = void*;

enum pcnt_channel_edge_action_t {
  PCNT_CHANNEL_EDGE_ACTION_INCREASE,
  PCNT_CHANNEL_EDGE_ACTION_DECREASE
};
enum pcnt_channel_level_action_t {
  PCNT_CHANNEL_LEVEL_ACTION_KEEP,
  PCNT_CHANNEL_LEVEL_ACTION_INVERSE
};

struct pcnt_unit_config_t {
  int low_limit;
  int high_limit;
};
struct pcnt_chan_flags_t {};
struct pcnt_chan_config_t {
  int edge_gpio_num;
  int level_gpio_num;
  pcnt_chan_flags_t flags;
};
struct pcnt_glitch_filter_config_t {
  uint32_t max_glitch_ns;
};

inline esp_err_t pcnt_new_unit(const pcnt_unit_config_t*, pcnt_unit_handle_t* unit) {
  static int any;
  *unit = &any;
  return ESP_OK;
}
inline esp_err_t pcnt_new_channel(pcnt_unit_handle_t, const pcnt_chan_config_t* config,
                                  pcnt_channel_handle_t*) {
  for (const int pin : {config->edge_gpio_num, config->level_gpio_num}) {
    fake_matrix.pulled_up[pin] = true;
    fake_matrix.look();
  }
  return ESP_OK;
}
inline esp_err_t pcnt_channel_set_edge_action(pcnt_channel_handle_t, pcnt_channel_edge_action_t,
                                              pcnt_channel_edge_action_t) {
  return ESP_OK;
}
inline esp_err_t pcnt_channel_set_level_action(pcnt_channel_handle_t, pcnt_channel_level_action_t,
                                               pcnt_channel_level_action_t) {
  return ESP_OK;
}
inline esp_err_t pcnt_unit_set_glitch_filter(pcnt_unit_handle_t,
                                             const pcnt_glitch_filter_config_t*) {
  return ESP_OK;
}
inline esp_err_t pcnt_unit_add_watch_point(pcnt_unit_handle_t, int) { return ESP_OK; }
inline esp_err_t pcnt_unit_enable(pcnt_unit_handle_t) { return ESP_OK; }
inline esp_err_t pcnt_unit_clear_count(pcnt_unit_handle_t) { return ESP_OK; }
inline esp_err_t pcnt_unit_start(pcnt_unit_handle_t) { return ESP_OK; }
inline esp_err_t pcnt_unit_get_count(pcnt_unit_handle_t, int* count) {
  *count = 0;
  return ESP_OK;
}
