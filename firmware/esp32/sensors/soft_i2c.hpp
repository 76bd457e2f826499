// An I2C bus by two pins, level by level. Every wait has a bound, and no interrupt is involved.
// The driver of ESP-IDF 5.4 waits without one for a line that is held low, also in its interrupt:
// a short of the bus would restart a robot that drives.
#pragma once

#include "i2c_bus.hpp"

namespace wheelwire {

/// Two open-drain pins, each against a pull-up.
class I2cLines {
 public:
  /// Pulls it low, or lets go of it.
  virtual void set_clock(bool high) = 0;
  virtual void set_data(bool high) = 0;
  virtual bool clock() = 0;
  virtual bool data() = 0;
  /// At least half of a clock's low time: 0.65 us at 400 kHz.
  virtual void wait() = 0;
  virtual uint64_t now_us() = 0;

 protected:
  ~I2cLines() = default;
};

class SoftI2c final : public I2cBus {
 public:
  explicit SoftI2c(I2cLines& lines) : lines_(lines) {}

  I2cResult write(uint8_t address, const uint8_t* data, size_t size) override;
  I2cResult read(uint8_t address, uint8_t at, uint8_t* out, size_t size) override;
  void recover() override;
  uint64_t now_us() override { return lines_.now_us(); }

 private:
  // Each leaves the clock low; false: the bus hangs.
  bool begin();
  bool send(uint8_t byte, bool& is_acknowledged);
  bool receive(uint8_t& byte, bool is_last);
  bool bit(bool out, bool& in);
  /// Lets go of the clock and waits until it is high: a chip may hold it for a while.
  bool raise_clock();

  I2cResult send_all(uint8_t address, const uint8_t* data, size_t size);
  I2cResult receive_all(uint8_t address, uint8_t* out, size_t size);
  /// The stop. What failed leaves a bus that is free, if a chip lets go of it.
  I2cResult end(I2cResult result);

  I2cLines& lines_;
  uint64_t deadline_us_ = 0;
};

}  // namespace wheelwire
