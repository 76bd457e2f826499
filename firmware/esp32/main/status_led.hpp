#pragma once

#include <stdint.h>

#include "gpio_pin.hpp"
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

/// `pin`: -1: there is none.
inline void start_status_led(int pin) {
  if (pin >= 0) make_low_output(pin);
}

inline void show_on_status_led(int pin, SupervisorState state, uint32_t time_ms) {
  if (pin >= 0) gpio_set_level(static_cast<gpio_num_t>(pin), is_lit(state, time_ms));
}

}  // namespace wheelwire
