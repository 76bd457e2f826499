#include "echo_pin.hpp"

#include "esp_attr.h"
#include "esp_rom_sys.h"
#include "esp_timer.h"
#include "sdkconfig.h"
#include "soc/soc_caps.h"

// The interrupt must be in RAM: otherwise an edge during a flash write would get the time of the
// write's end.
#if !CONFIG_MCPWM_ISR_CACHE_SAFE
#error \
    "Range sensors need CONFIG_MCPWM_ISR_CACHE_SAFE=y: it is in sdkconfig.defaults; delete the build folder, or its sdkconfig, and build again"
#endif

namespace wheelwire {
namespace {

/// The last group. The motors' PWM is in group 0; where that is the only one both share its clock,
/// 80 MHz, and nothing else.
constexpr int kGroup = SOC_MCPWM_GROUPS - 1;

}  // namespace

bool CaptureTimer::start() {
  // Its resolution is what the group's clock gives: 80 MHz on every chip.
  const mcpwm_capture_timer_config_t config = {
      .group_id = kGroup,
      .clk_src = MCPWM_CAPTURE_CLK_SRC_DEFAULT,
      .resolution_hz = 0,
      .flags = {},
  };
  return mcpwm_new_capture_timer(&config, &handle_) == ESP_OK &&
         mcpwm_capture_timer_enable(handle_) == ESP_OK &&
         mcpwm_capture_timer_start(handle_) == ESP_OK &&
         mcpwm_capture_timer_get_resolution(handle_, &resolution_hz_) == ESP_OK &&
         ticks_per_us() != 0;
}

bool CaptureTimer::add_channel(const mcpwm_capture_channel_config_t& config,
                               const mcpwm_capture_event_callbacks_t& on_edge,
                               void* context) const {
  mcpwm_cap_channel_handle_t channel = nullptr;
  return mcpwm_new_capture_channel(handle_, &config, &channel) == ESP_OK &&
         mcpwm_capture_channel_register_event_callbacks(channel, &on_edge, context) == ESP_OK &&
         mcpwm_capture_channel_enable(channel) == ESP_OK;
}

bool EchoPin::start(const CaptureTimer& timer, const Peripheral& entry) {
  trigger_ = entry.pin_a;
  echo_ = entry.pin_b;
  ticks_per_us_ = timer.ticks_per_us();
  if (!make_low_output(trigger_) || !make_sensor_input(echo_)) return false;
  mcpwm_capture_channel_config_t config = {};
  config.gpio_num = echo_;
  config.prescale = 1;
  config.flags.pos_edge = true;
  config.flags.neg_edge = true;
  // Otherwise the driver of ESP-IDF 5.5 would undo what make_sensor_input() has switched on.
  config.flags.pull_down = can_pull(echo_);
  return timer.add_channel(config, {.on_cap = on_edge}, this);
}

void EchoPin::trigger(uint32_t us) {
  set_level(trigger_, true);
  esp_rom_delay_us(us);
  set_level(trigger_, false);
}

/// A pulse goes on where it was low for too short a time, whether or not that fall was seen: of two
/// edges before the interrupt comes the unit keeps the second one.
[[gnu::always_inline]] inline void EchoPin::rise(uint32_t ticks) {
  if (has_rise_) return;
  has_rise_ = true;
  if (has_pulse_ && ticks - fall_ticks_ < kSpikeUs * ticks_per_us_) {
    has_pulse_ = false;
  } else {
    rise_ticks_ = ticks;
  }
}

[[gnu::always_inline]] inline void EchoPin::fall(uint32_t ticks, uint64_t now_us) {
  if (!has_rise_) return;
  has_rise_ = false;
  const uint32_t length = ticks - rise_ticks_;
  if (length < kSpikeUs * ticks_per_us_) return;
  has_pulse_ = true;
  pulse_ticks_ = length;
  fall_ticks_ = ticks;
  fall_us_ = now_us;
}

IRAM_ATTR bool EchoPin::on_edge(mcpwm_cap_channel_handle_t, const mcpwm_capture_event_data_t* edge,
                                void* self) {
  auto& pin = *static_cast<EchoPin*>(self);
  const auto now_us = static_cast<uint64_t>(esp_timer_get_time());
  portENTER_CRITICAL_ISR(&pin.lock_);
  if (edge->cap_edge == MCPWM_CAP_EDGE_POS) {
    pin.rise(edge->cap_value);
  } else {
    pin.fall(edge->cap_value, now_us);
  }
  portEXIT_CRITICAL_ISR(&pin.lock_);
  return false;
}

/// The counter is not the device clock: it gives the length, and the interrupt the time. It wraps
/// after 53 s, which no echo lasts.
bool EchoPin::take(EchoPulse& out) {
  portENTER_CRITICAL(&lock_);
  const bool has_pulse = has_pulse_;
  const uint32_t ticks = pulse_ticks_;
  const uint64_t fall_us = fall_us_;
  has_pulse_ = false;
  portEXIT_CRITICAL(&lock_);
  if (!has_pulse) return false;
  const uint32_t length_us = ticks / ticks_per_us_;
  out = {.rise_us = fall_us - length_us, .length_us = length_us};
  return true;
}

}  // namespace wheelwire
