// Two pins of this chip as the lines of an I2C bus.
#pragma once

#include "soft_i2c.hpp"

namespace wheelwire {

class I2cPins final : public I2cLines {
 public:
  /// Open drain, both let go of. The chip's own pull-ups are weak and only help: modules have some
  /// of their own.
  bool start(int data, int clock);

  bool is_on(int data, int clock) const { return data == data_ && clock == clock_; }

  void set_clock(bool high) override;
  void set_data(bool high) override;
  bool clock() override;
  bool data() override;
  void wait() override;
  uint64_t now_us() override;

 private:
  int data_ = -1;
  int clock_ = -1;
};

}  // namespace wheelwire
