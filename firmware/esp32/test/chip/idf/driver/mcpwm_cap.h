// The capture unit as its driver sets it up: a test gives it edges.
#pragma once

#include <vector>

#include "driver/gpio.h"
#include "esp_err.h"

using mcpwm_cap_timer_handle_t = int*;
using mcpwm_cap_channel_handle_t = int*;

enum mcpwm_capture_clock_t { MCPWM_CAPTURE_CLK_SRC_DEFAULT };
enum mcpwm_capture_edge_t { MCPWM_CAP_EDGE_POS, MCPWM_CAP_EDGE_NEG };

struct mcpwm_capture_timer_config_t {
  int group_id;
  mcpwm_capture_clock_t clk_src;
  uint32_t resolution_hz;
  struct {
    uint32_t allow_pd;
  } flags;
};
struct mcpwm_capture_channel_config_t {
  int gpio_num;
  int intr_priority;
  uint32_t prescale;
  struct {
    uint32_t pos_edge;
    uint32_t neg_edge;
    uint32_t pull_up;
    uint32_t pull_down;
  } flags;
};
struct mcpwm_capture_event_data_t {
  uint32_t cap_value;
  mcpwm_capture_edge_t cap_edge;
};
struct mcpwm_capture_event_callbacks_t {
  bool (*on_cap)(mcpwm_cap_channel_handle_t, const mcpwm_capture_event_data_t*, void*);
};

constexpr size_t kFakeCaptureChannels = 3;

struct FakeCapture {
  struct Channel {
    mcpwm_capture_channel_config_t config{};
    mcpwm_capture_event_callbacks_t callbacks{};
    void* context = nullptr;
    bool is_enabled = false;
  };

  uint32_t resolution_hz = 80'000'000;
  esp_err_t timer_result = ESP_OK;
  int timers = 0;
  int group = -1;
  bool is_enabled = false;
  bool runs = false;
  std::vector<Channel> channels;

  /// An edge at a pin, with this value of the counter.
  void edge(int pin, bool rises, uint32_t ticks) {
    for (Channel& channel : channels) {
      if (channel.config.gpio_num != pin || !channel.is_enabled || !runs) continue;
      if (!(rises ? channel.config.flags.pos_edge : channel.config.flags.neg_edge)) continue;
      const mcpwm_capture_event_data_t data = {ticks,
                                               rises ? MCPWM_CAP_EDGE_POS : MCPWM_CAP_EDGE_NEG};
      channel.callbacks.on_cap(nullptr, &data, channel.context);
    }
  }
};
inline FakeCapture fake_capture;
/// What the handles of channels point to: their indices.
inline int fake_capture_indices[kFakeCaptureChannels] = {0, 1, 2};

inline esp_err_t mcpwm_new_capture_timer(const mcpwm_capture_timer_config_t* config,
                                         mcpwm_cap_timer_handle_t* timer) {
  *timer = &fake_capture.timers;
  fake_capture.group = config->group_id;
  return ++fake_capture.timers == 1 ? fake_capture.timer_result : ESP_FAIL;
}
inline esp_err_t mcpwm_capture_timer_enable(mcpwm_cap_timer_handle_t) {
  fake_capture.is_enabled = true;
  return ESP_OK;
}
inline esp_err_t mcpwm_capture_timer_start(mcpwm_cap_timer_handle_t) {
  fake_capture.runs = fake_capture.is_enabled;
  return fake_capture.runs ? ESP_OK : ESP_FAIL;
}
inline esp_err_t mcpwm_capture_timer_get_resolution(mcpwm_cap_timer_handle_t,
                                                    uint32_t* resolution_hz) {
  *resolution_hz = fake_capture.resolution_hz;
  return ESP_OK;
}
inline esp_err_t mcpwm_new_capture_channel(mcpwm_cap_timer_handle_t timer,
                                           const mcpwm_capture_channel_config_t* config,
                                           mcpwm_cap_channel_handle_t* channel) {
  const size_t count = fake_capture.channels.size();
  if (timer == nullptr || config->prescale == 0 || count == kFakeCaptureChannels) return ESP_FAIL;
  fake_capture.channels.push_back({.config = *config});
  fake_matrix.pulled_down[config->gpio_num] = config->flags.pull_down != 0;
  fake_matrix.pulled_up[config->gpio_num] = config->flags.pull_up != 0;
  *channel = &fake_capture_indices[count];
  return ESP_OK;
}
inline esp_err_t mcpwm_capture_channel_register_event_callbacks(
    mcpwm_cap_channel_handle_t channel, const mcpwm_capture_event_callbacks_t* callbacks,
    void* context) {
  FakeCapture::Channel& known = fake_capture.channels[static_cast<size_t>(*channel)];
  known.callbacks = *callbacks;
  known.context = context;
  return known.is_enabled ? ESP_FAIL : ESP_OK;
}
inline esp_err_t mcpwm_capture_channel_enable(mcpwm_cap_channel_handle_t channel) {
  fake_capture.channels[static_cast<size_t>(*channel)].is_enabled = true;
  return ESP_OK;
}
