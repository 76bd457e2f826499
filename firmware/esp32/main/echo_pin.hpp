// A range sensor on two pins of this chip. MCPWM's capture unit times the edges of the echo, so a
// busy processor does not delay them.
#pragma once

#include "driver/mcpwm_prelude.h"
#include "freertos/FreeRTOS.h"
#include "gpio_pin.hpp"
#include "range_finder.hpp"

namespace wheelwire {

/// The counter behind the edges of all echoes.
class CaptureTimer {
 public:
  bool start();
  /// Calls `on_edge` with `context` in the interrupt of each edge that `config` names.
  bool add_channel(const mcpwm_capture_channel_config_t& config,
                   const mcpwm_capture_event_callbacks_t& on_edge, void* context) const;
  uint32_t resolution_hz() const { return resolution_hz_; }
  uint32_t ticks_per_us() const { return resolution_hz_ / 1'000'000; }

 private:
  mcpwm_cap_timer_handle_t handle_ = nullptr;
  uint32_t resolution_hz_ = 0;
};

class EchoPin final : public EchoPins {
 public:
  /// Shorter levels are ignored: they come from the motors' wires, or on GPIO 36 and 39 of an ESP32
  /// from its ADC. At the speed of sound this is two millimetres.
  static constexpr uint32_t kSpikeUs = 10;

  /// `timer`: started.
  bool start(const CaptureTimer& timer, const Peripheral& entry);

  void trigger(uint32_t us) override;
  bool level() override { return is_high(echo_); }
  bool take(EchoPulse& out) override;

 private:
  void rise(uint32_t ticks);
  void fall(uint32_t ticks, uint64_t now_us);
  static bool on_edge(mcpwm_cap_channel_handle_t, const mcpwm_capture_event_data_t* edge,
                      void* self);

  int trigger_ = -1;
  int echo_ = -1;
  uint32_t ticks_per_us_ = 0;
  portMUX_TYPE lock_ = portMUX_INITIALIZER_UNLOCKED;
  // Written by the interrupt, under the lock.
  bool has_rise_ = false;
  uint32_t rise_ticks_ = 0;
  bool has_pulse_ = false;
  uint32_t pulse_ticks_ = 0;  // Its length.
  uint32_t fall_ticks_ = 0;
  uint64_t fall_us_ = 0;
};

}  // namespace wheelwire
