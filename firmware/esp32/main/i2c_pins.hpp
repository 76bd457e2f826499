// Two pins of this chip as the lines of an I2C bus.
#pragma once

#include "clock.hpp"
#include "esp_rom_sys.h"
#include "gpio_pin.hpp"
#include "soft_i2c.hpp"

namespace wheelwire {

class I2cPins final : public I2cLines {
 public:
  /// Open drain, both let go of. The chip's own pull-ups are weak and only help: modules have some
  /// of their own.
  bool start(int data, int clock) {
    data_ = data;
    clock_ = clock;
    // High before they are outputs: a low level on one of them would be a start.
    set_data(true);
    set_clock(true);
    return configure(mask_of(data) | mask_of(clock), GPIO_MODE_INPUT_OUTPUT_OD, {.up = true});
  }

  bool is_on(int data, int clock) const { return data == data_ && clock == clock_; }

  void set_clock(bool high) override { set_level(clock_, high); }
  void set_data(bool high) override { set_level(data_, high); }
  bool clock() override { return is_high(clock_); }
  bool data() override { return is_high(data_); }
  void wait() override { esp_rom_delay_us(1); }
  uint64_t now_us() override { return wheelwire::now_us(); }

 private:
  int data_ = -1;
  int clock_ = -1;
};

}  // namespace wheelwire
