#include "pulse_watch.hpp"

#include <algorithm>

#include "clock.hpp"
#include "esp_attr.h"
#include "soc/gpio_reg.h"
#include "soc/soc.h"

namespace wheelwire {
namespace {

/// Start-up code leaves it: it tells when a core that froze let go of the motors.
__NOINIT_ATTR uint64_t last_fall;

[[gnu::always_inline]] inline void widen(uint32_t& least, uint32_t& most, uint32_t ticks) {
  least = least == 0 ? ticks : std::min(least, ticks);
  most = std::max(most, ticks);
}

/// Whether a moment of the counter, which wraps, comes after another.
[[gnu::always_inline]] inline bool is_after(uint32_t ticks, uint32_t other) {
  return static_cast<int32_t>(ticks - other) > 0;
}

}  // namespace

/// By its register: the driver's function is in flash. A member, since the macro declares a
/// function, which no unnamed namespace may have without a definition.
[[gnu::always_inline]] inline bool PulseWatch::is_high(int pin) {
  if (pin < 32) return REG_READ(GPIO_IN_REG) >> pin & 1;
  return REG_READ(GPIO_IN1_REG) >> (pin - 32) & 1;
}

bool PulseWatch::start(int edge_pin, int level_pin, bool pulled_up) {
  edge_pin_ = edge_pin;
  level_pin_ = level_pin;
  last_fall = 0;
  // That of the range sensors, which a board in a self-test has none of.
  CaptureTimer timer;
  if (!timer.start() || !add_channel(timer, true, pulled_up) ||
      !add_channel(timer, false, pulled_up))
    return false;
  resolution_hz_ = timer.resolution_hz();
  return true;
}

bool PulseWatch::add_channel(const CaptureTimer& timer, bool rises, bool pulled_up) {
  mcpwm_capture_channel_config_t config = {};
  config.gpio_num = edge_pin_;
  config.prescale = 1;
  config.flags.pos_edge = rises;
  config.flags.neg_edge = !rises;
  config.flags.pull_up = pulled_up;  // Else the driver would switch off the encoder's.
  return timer.add_channel(config, {.on_cap = rises ? on_rise : on_fall}, this);
}

Pulses PulseWatch::take() {
  portENTER_CRITICAL(&lock_);
  const Pulses taken = pulses_;
  pulses_ = {};
  has_rise_ = false;
  awaits_fall_ = false;
  portEXIT_CRITICAL(&lock_);
  return taken;
}

uint64_t PulseWatch::last_fall_us() { return last_fall; }

IRAM_ATTR bool PulseWatch::on_rise(mcpwm_cap_channel_handle_t,
                                   const mcpwm_capture_event_data_t* edge, void* self) {
  auto& watch = *static_cast<PulseWatch*>(self);
  portENTER_CRITICAL_ISR(&watch.lock_);
  if (watch.has_rise_)
    widen(watch.pulses_.least_period, watch.pulses_.most_period,
          edge->cap_value - watch.rise_ticks_);
  ++watch.pulses_.rises;
  watch.has_rise_ = true;
  watch.rise_ticks_ = edge->cap_value;
  watch.is_other_ = !is_high(watch.level_pin_);
  // Of a short pulse the end may be reported first.
  watch.awaits_fall_ = !(watch.has_fall_ && is_after(watch.fall_ticks_, watch.rise_ticks_));
  if (!watch.awaits_fall_) watch.note_high();
  portEXIT_CRITICAL_ISR(&watch.lock_);
  return false;
}

IRAM_ATTR bool PulseWatch::on_fall(mcpwm_cap_channel_handle_t,
                                   const mcpwm_capture_event_data_t* edge, void* self) {
  const uint64_t t_us = now_us();
  auto& watch = *static_cast<PulseWatch*>(self);
  portENTER_CRITICAL_ISR(&watch.lock_);
  last_fall = t_us;
  ++watch.pulses_.falls;
  watch.fall_ticks_ = edge->cap_value;
  watch.has_fall_ = !watch.awaits_fall_;
  if (watch.awaits_fall_ && is_after(watch.fall_ticks_, watch.rise_ticks_)) watch.note_high();
  portEXIT_CRITICAL_ISR(&watch.lock_);
  return false;
}

[[gnu::always_inline]] inline void PulseWatch::note_high() {
  const uint32_t ticks = fall_ticks_ - rise_ticks_;
  awaits_fall_ = false;
  has_fall_ = false;
  widen(pulses_.least_high, pulses_.most_high, ticks);
  if (is_other_) pulses_.most_high_other = std::max(pulses_.most_high_other, ticks);
}

}  // namespace wheelwire
