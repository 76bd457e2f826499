// Both quadrature encoders in the pulse counter (PCNT), x4, without an interrupt.
#pragma once

#include "board_rules.hpp"
#include "clock.hpp"
#include "driver/gpio.h"
#include "driver/pulse_cnt.h"
#include "freertos/FreeRTOS.h"
#include "hal.hpp"

namespace wheelwire {

class Encoders final : public EncoderPort {
 public:
  /// Pulses shorter than `glitch_ns` are ignored; 0 ignores none.
  bool start(const BoardDescription& board, uint32_t glitch_ns) {
    const EncoderPulls pulls = board.encoder_pulls;
    return start_unit(left_, {board.left_encoder_a, board.left_encoder_b, pulls}, glitch_ns) &&
           start_unit(right_, {board.right_encoder_a, board.right_encoder_b, pulls}, glitch_ns);
  }

  EncoderCounts latch() override {
    // No interrupt of this core may come between reading the two counters and the clock.
    portENTER_CRITICAL(&latch_lock_);
    const EncoderCounts counts = {
        .t_us = now_us(), .left = count_of(left_), .right = count_of(right_)};
    portEXIT_CRITICAL(&latch_lock_);
    return counts;
  }

 private:
  static bool add_channel(pcnt_unit_handle_t unit, int edge_pin, int level_pin,
                          pcnt_channel_edge_action_t rising, pcnt_channel_edge_action_t falling) {
    const pcnt_chan_config_t config = {
        .edge_gpio_num = edge_pin,
        .level_gpio_num = level_pin,
        .flags = {},
    };
    pcnt_channel_handle_t channel = nullptr;
    return pcnt_new_channel(unit, &config, &channel) == ESP_OK &&
           pcnt_channel_set_edge_action(channel, rising, falling) == ESP_OK &&
           pcnt_channel_set_level_action(channel, PCNT_CHANNEL_LEVEL_ACTION_KEEP,
                                         PCNT_CHANNEL_LEVEL_ACTION_INVERSE) == ESP_OK;
  }

  struct EncoderPins {
    int a;
    int b;
    EncoderPulls pulls;
  };

  /// Counts every edge of A and B, up while A leads.
  static bool add_quadrature(pcnt_unit_handle_t unit, const EncoderPins& pins) {
    constexpr auto kUp = PCNT_CHANNEL_EDGE_ACTION_INCREASE;
    constexpr auto kDown = PCNT_CHANNEL_EDGE_ACTION_DECREASE;
    return add_channel(unit, pins.a, pins.b, kDown, kUp) &&
           add_channel(unit, pins.b, pins.a, kUp, kDown);
  }

  /// pcnt_new_channel() of ESP-IDF 5.5 switches both pull-ups on, whatever the board has.
  /// Input-only pins have no pull-ups: the rules require external ones there.
  static bool set_pulls(const EncoderPins& pins) {
    const bool internal = pins.pulls == EncoderPulls::kInternal;
    const gpio_pull_mode_t mode = internal ? GPIO_PULLUP_ONLY : GPIO_FLOATING;
    return gpio_set_pull_mode(static_cast<gpio_num_t>(pins.a), mode) == ESP_OK &&
           gpio_set_pull_mode(static_cast<gpio_num_t>(pins.b), mode) == ESP_OK;
  }

  /// The counter returns to 0 at its limits. Watch points there enable their comparators, but no
  /// interrupt: the driver installs one only for accum_count or a callback.
  static bool watch_limits(pcnt_unit_handle_t unit) {
    return pcnt_unit_add_watch_point(unit, kCounterLimit) == ESP_OK &&
           pcnt_unit_add_watch_point(unit, -kCounterLimit) == ESP_OK;
  }

  static bool filter_glitches(pcnt_unit_handle_t unit, uint32_t glitch_ns) {
    if (glitch_ns == 0) return true;
    const pcnt_glitch_filter_config_t filter = {.max_glitch_ns = glitch_ns};
    return pcnt_unit_set_glitch_filter(unit, &filter) == ESP_OK;
  }

  /// Limits take effect only at a clear; the counter is not cleared again.
  static bool start_unit(pcnt_unit_handle_t& unit, const EncoderPins& pins, uint32_t glitch_ns) {
    pcnt_unit_config_t config = {};
    config.low_limit = -kCounterLimit;
    config.high_limit = kCounterLimit;
    return pcnt_new_unit(&config, &unit) == ESP_OK && filter_glitches(unit, glitch_ns) &&
           add_quadrature(unit, pins) && set_pulls(pins) && watch_limits(unit) &&
           pcnt_unit_enable(unit) == ESP_OK && pcnt_unit_clear_count(unit) == ESP_OK &&
           pcnt_unit_start(unit) == ESP_OK;
  }

  static int16_t count_of(pcnt_unit_handle_t unit) {
    int count = 0;
    if (unit != nullptr) pcnt_unit_get_count(unit, &count);
    return static_cast<int16_t>(count);
  }

  portMUX_TYPE latch_lock_ = portMUX_INITIALIZER_UNLOCKED;
  pcnt_unit_handle_t left_ = nullptr;
  pcnt_unit_handle_t right_ = nullptr;
};

}  // namespace wheelwire
