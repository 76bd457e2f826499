// The GPIO matrix with the PWM before it: what a pin shows at any time of the test's clock.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <array>
#include <map>
#include <set>
#include <vector>

#include "esp_timer.h"
#include "soc/gpio_reg.h"
#include "soc/gpio_sig_map.h"

/// Signals of PWM outputs in the matrix, upwards from here.
constexpr uint32_t kFirstPwmSignal = 32;

/// A timer of the PWM, counting up. Its period begins when the counter is 0.
struct FakePwmTimer {
  uint32_t resolution_hz = 0;
  uint32_t period_ticks = 0;
  bool is_enabled = false;
  bool runs = false;
  int64_t start_us = 0;

  /// How many ticks have passed since the start.
  int64_t ticks_at(int64_t t_ns) const {
    return (t_ns - 1000 * start_us) * (resolution_hz / 1'000'000) / 1000;
  }
  int64_t period_at(int64_t t_ns) const { return runs ? ticks_at(t_ns) / period_ticks : -1; }
};

/// One bit of each pin. Looked up many million times under the sanitizers: no map.
class PinFlags {
 public:
  bool& operator[](int pin) { return flags_.at(static_cast<size_t>(pin)); }

 private:
  std::array<bool, 64> flags_{};
};

/// The registers as a reset leaves them: each pin shows its plain output. No map, either.
class GpioRegisters {
 public:
  GpioRegisters() {
    for (int pin = 0; pin < 64; ++pin) route(pin) = SIG_GPIO_OUT_IDX;
  }
  uint32_t& operator[](uint32_t address) { return words_.at(address / 4); }
  /// Which signal the pin shows.
  uint32_t& route(int pin) {
    return (*this)[GPIO_FUNC0_OUT_SEL_CFG_REG + 4 * static_cast<uint32_t>(pin)];
  }

 private:
  std::array<uint32_t, GPIO_FUNC0_OUT_SEL_CFG_REG / 4 + 64> words_{};
};

struct FakeMatrix {
  /// One output of the PWM, as far as it is set up: high from the start of a period until the
  /// counter reaches the active compare value.
  struct Output {
    bool rises = false;
    bool falls = false;
    bool loads_at_start = false;  ///< The active value follows its shadow at a period's start only.
    uint32_t active = 0;
    uint32_t shadow = 0;
    int64_t written_in = -1;  ///< The period in which the shadow was written.
    uint32_t signal = 0;
    const FakePwmTimer* timer = nullptr;

    void write(uint32_t compare, int64_t t_ns) {
      load(t_ns);
      shadow = compare;
      written_in = timer->period_at(t_ns);
      if (!loads_at_start) active = compare;
    }
    void load(int64_t t_ns) {
      if (timer->period_at(t_ns) > written_in) active = shadow;
    }
    bool level_at(int64_t t_ns) {
      load(t_ns);
      if (!timer->runs || !rises) return false;
      return !falls || timer->ticks_at(t_ns) % timer->period_ticks < active;
    }
  };

  GpioRegisters registers;
  // What a reset of the CPU leaves as it was.
  PinFlags levels;      // of plain outputs
  PinFlags enabled;     // which pins the chip drives
  PinFlags open_drain;  // inputs that the chip may also pull low
  PinFlags pulled_up;
  PinFlags pulled_down;
  PinFlags interrupts;  // on a rising edge
  std::map<uint32_t, Output> outputs;
  FakePwmTimer pwm;
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
    if (!enabled[pin]) return false;
    const uint32_t signal = registers.route(pin);
    return signal == SIG_GPIO_OUT_IDX ? levels[pin] : is_high(signal);
  }

  /// Whether the output is high at some time of this period or of the next one. One that rises
  /// stays high until it falls, which it does at once with a compare value of 0.
  bool is_high(uint32_t signal) {
    const auto found = outputs.find(signal);
    if (found == outputs.end()) return false;
    const Output& output = found->second;
    return pwm.runs && output.rises && (!output.falls || output.active > 0 || output.shadow > 0);
  }

  /// What the pin shows at a time that is not before the last write, in nanoseconds.
  bool level_at(int pin, int64_t t_ns) {
    if (!enabled[pin]) return false;
    const uint32_t signal = registers.route(pin);
    if (signal == SIG_GPIO_OUT_IDX) return levels[pin];
    const auto found = outputs.find(signal);
    return found != outputs.end() && found->second.level_at(t_ns);
  }
};

inline FakeMatrix fake_matrix;
