#pragma once

#include <stdint.h>

#include "board/board.hpp"
#include "driver/gpio.h"
#include "protocol.hpp"

namespace wheelwire {

/// Whether the LED is on. Short blinks: ready; steady: driving; slow blinking: timed out; fast
/// blinking: e-stop or fault.
constexpr bool is_lit(SupervisorState state, uint32_t time_ms) {
  switch (state) {
    case SupervisorState::kBoot:
      return false;
    case SupervisorState::kIdle:
      return time_ms % 2000 < 100;
    case SupervisorState::kDriving:
      return true;
    case SupervisorState::kTimedOut:
      return time_ms % 1000 < 500;
    case SupervisorState::kEstopped:
    case SupervisorState::kFault:
      return time_ms % 200 < 100;
  }
  return false;
}

inline void start_status_led() {
#if CONFIG_WHEELWIRE_STATUS_LED
  const gpio_config_t config = {
      .pin_bit_mask = mask_of(kPins.status_led),
      .mode = GPIO_MODE_OUTPUT,
      .pull_up_en = GPIO_PULLUP_DISABLE,
      .pull_down_en = GPIO_PULLDOWN_DISABLE,
      .intr_type = GPIO_INTR_DISABLE,
  };
  gpio_config(&config);
#endif
}

inline void show_on_status_led([[maybe_unused]] SupervisorState state,
                               [[maybe_unused]] uint32_t time_ms) {
#if CONFIG_WHEELWIRE_STATUS_LED
  gpio_set_level(static_cast<gpio_num_t>(kPins.status_led), is_lit(state, time_ms));
#endif
}

}  // namespace wheelwire
