// The GPIO matrix with the PWM before it: enough to tell whether an output was ever high.
#pragma once

#include <stdint.h>

#include <map>
#include <set>
#include <vector>

#include "soc/gpio_reg.h"
#include "soc/gpio_sig_map.h"

/// Signals of PWM outputs in the matrix, upwards from here.
constexpr uint32_t kFirstPwmSignal = 32;

struct FakeMatrix {
  /// One output of the PWM, as far as it is set up.
  struct Output {
    bool rises = false;
    bool falls = false;
    uint32_t compare = 0;
    uint32_t signal = 0;
  };

  std::map<uint32_t, uint32_t> registers;
  // What a reset of the CPU leaves as it was.
  std::map<int, bool> levels;      // of plain outputs
  std::map<int, bool> enabled;     // which pins the chip drives
  std::map<int, bool> open_drain;  // inputs that the chip may also pull low
  std::map<int, bool> pulled_up;
  std::map<int, bool> pulled_down;
  std::map<int, bool> interrupts;  // on a rising edge
  std::map<uint32_t, Output> outputs;
  bool pwm_runs = false;
  std::set<int> ever_high;

  void write(uint32_t address, uint32_t value) {
    registers[address] = value;
    for (int bit = 0; bit < 32; ++bit) {
      if (!(value & uint32_t{1} << bit)) continue;
      if (address == GPIO_OUT_W1TC_REG) levels[bit] = false;
      if (address == GPIO_OUT1_W1TC_REG) levels[32 + bit] = false;
      if (address == GPIO_ENABLE_W1TS_REG) enabled[bit] = true;
      if (address == GPIO_ENABLE1_W1TS_REG) enabled[32 + bit] = true;
      if (address == GPIO_ENABLE_W1TC_REG) enabled[bit] = false;
      if (address == GPIO_ENABLE1_W1TC_REG) enabled[32 + bit] = false;
    }
    look();
  }

  /// As the driver does it: from a peripheral back to the GPIO registers.
  void take_from_peripherals(int pin) {
    write(GPIO_FUNC0_OUT_SEL_CFG_REG + 4 * static_cast<uint32_t>(pin), SIG_GPIO_OUT_IDX);
  }

  /// Some PWM periods pass: which pins are high in them?
  void look() {
    for (int pin = 0; pin < 40; ++pin)
      if (can_be_high(pin)) ever_high.insert(pin);
  }

  /// Whether the pin is high at some time of a PWM period.
  bool can_be_high(int pin) {
    const auto route = registers.find(GPIO_FUNC0_OUT_SEL_CFG_REG + 4 * static_cast<uint32_t>(pin));
    if (!enabled[pin]) return false;
    if (route == registers.end() || route->second == SIG_GPIO_OUT_IDX) return levels[pin];
    return is_high(route->second);
  }

  /// An output that rises stays high until it falls, which it does at once with a compare of 0.
  bool is_high(uint32_t signal) {
    const auto found = outputs.find(signal);
    if (found == outputs.end()) return false;
    const Output& output = found->second;
    return pwm_runs && output.rises && (!output.falls || output.compare > 0);
  }
};

inline FakeMatrix fake_matrix;
