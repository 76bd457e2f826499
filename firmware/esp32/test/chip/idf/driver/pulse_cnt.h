// The pulse counter. A new channel pulls both its pins up and enables their inputs, and leaves an
// output enabled, as in ESP-IDF 5.5. A test sets the levels of the pins.
#pragma once

#include <deque>
#include <map>
#include <set>
#include <vector>

#include "driver/gpio.h"

enum pcnt_channel_edge_action_t {
  PCNT_CHANNEL_EDGE_ACTION_INCREASE,
  PCNT_CHANNEL_EDGE_ACTION_DECREASE
};
enum pcnt_channel_level_action_t {
  PCNT_CHANNEL_LEVEL_ACTION_KEEP,
  PCNT_CHANNEL_LEVEL_ACTION_INVERSE
};

/// A unit counts the edges of its channels. It ignores a level that lasts for less than its filter.
struct FakePcntUnit {
  struct Channel {
    int edge_pin;
    int level_pin;
    pcnt_channel_edge_action_t rising{};
    pcnt_channel_edge_action_t falling{};
    pcnt_channel_level_action_t high{};
    pcnt_channel_level_action_t low{};
  };
  struct Input {
    bool level = false;  ///< At the pin.
    bool seen = false;   ///< Behind the filter.
    int64_t changed_ns = 0;
  };

  int low_limit = 0;
  int high_limit = 0;
  std::set<int> watched;  ///< The counter returns to 0 at a limit whose comparator is enabled.
  int64_t filter_ns = 0;
  bool is_enabled = false;
  bool runs = false;
  int count = 0;
  std::deque<Channel> channels;
  std::map<int, Input> inputs;

  void set(int pin, bool level, int64_t t_ns) {
    const auto found = inputs.find(pin);
    if (found == inputs.end()) return;
    settle(t_ns);
    if (found->second.level != level) found->second.changed_ns = t_ns;
    found->second.level = level;
    settle(t_ns);
  }
  /// What has lasted long enough by this time is seen, in the order in which it happened.
  void settle(int64_t t_ns) {
    for (;;) {
      int next = -1;
      for (const auto& [pin, input] : inputs)
        if (input.level != input.seen && t_ns - input.changed_ns >= filter_ns &&
            (next < 0 || input.changed_ns < inputs[next].changed_ns))
          next = pin;
      if (next < 0) return;
      inputs[next].seen = inputs[next].level;
      for (const Channel& channel : channels)
        if (channel.edge_pin == next) edge(channel, inputs[next].seen);
    }
  }
  void edge(const Channel& channel, bool rises) {
    if (!runs) return;
    const auto action = rises ? channel.rising : channel.falling;
    const auto level = inputs[channel.level_pin].seen ? channel.high : channel.low;
    const bool up =
        (action == PCNT_CHANNEL_EDGE_ACTION_INCREASE) == (level == PCNT_CHANNEL_LEVEL_ACTION_KEEP);
    count += up ? 1 : -1;
    const bool at_limit = count >= high_limit || count <= low_limit;
    if (at_limit && watched.count(count) != 0) count = 0;
    count = static_cast<int16_t>(count);
  }
};

inline std::deque<FakePcntUnit> fake_pcnt;

using pcnt_unit_handle_t = FakePcntUnit*;
using pcnt_channel_handle_t = FakePcntUnit::Channel*;

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

inline esp_err_t pcnt_new_unit(const pcnt_unit_config_t* config, pcnt_unit_handle_t* unit) {
  FakePcntUnit& made = fake_pcnt.emplace_back();
  made.low_limit = config->low_limit;
  made.high_limit = config->high_limit;
  *unit = &made;
  return config->low_limit < 0 && config->high_limit > 0 ? ESP_OK : ESP_FAIL;
}
inline esp_err_t pcnt_new_channel(pcnt_unit_handle_t unit, const pcnt_chan_config_t* config,
                                  pcnt_channel_handle_t* channel) {
  for (const int pin : {config->edge_gpio_num, config->level_gpio_num}) {
    fake_matrix.pulled_up[pin] = true;
    fake_matrix.look();
    unit->inputs[pin];
  }
  *channel = &unit->channels.emplace_back(FakePcntUnit::Channel{
      .edge_pin = config->edge_gpio_num, .level_pin = config->level_gpio_num});
  return ESP_OK;
}
inline esp_err_t pcnt_channel_set_edge_action(pcnt_channel_handle_t channel,
                                              pcnt_channel_edge_action_t rising,
                                              pcnt_channel_edge_action_t falling) {
  channel->rising = rising;
  channel->falling = falling;
  return ESP_OK;
}
inline esp_err_t pcnt_channel_set_level_action(pcnt_channel_handle_t channel,
                                               pcnt_channel_level_action_t high,
                                               pcnt_channel_level_action_t low) {
  channel->high = high;
  channel->low = low;
  return ESP_OK;
}
inline esp_err_t pcnt_unit_set_glitch_filter(pcnt_unit_handle_t unit,
                                             const pcnt_glitch_filter_config_t* filter) {
  unit->filter_ns = filter->max_glitch_ns;
  return ESP_OK;
}
inline esp_err_t pcnt_unit_add_watch_point(pcnt_unit_handle_t unit, int point) {
  return unit->watched.insert(point).second ? ESP_OK : ESP_FAIL;
}
inline esp_err_t pcnt_unit_enable(pcnt_unit_handle_t unit) {
  unit->is_enabled = true;
  return ESP_OK;
}
inline esp_err_t pcnt_unit_clear_count(pcnt_unit_handle_t unit) {
  unit->count = 0;
  return ESP_OK;
}
inline esp_err_t pcnt_unit_start(pcnt_unit_handle_t unit) {
  unit->runs = unit->is_enabled;
  return unit->runs ? ESP_OK : ESP_FAIL;
}
inline esp_err_t pcnt_unit_get_count(pcnt_unit_handle_t unit, int* count) {
  unit->settle(1000 * fake_time_us);
  *count = unit->count;
  return ESP_OK;
}
