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

  I2cResult write(uint8_t address, const uint8_t* data, size_t size) override {
    deadline_us_ = now_us() + kTransferUs;
    return end(send_all(address, data, size));
  }
  I2cResult read(uint8_t address, uint8_t at, uint8_t* out, size_t size) override {
    deadline_us_ = now_us() + kTransferUs;
    const I2cResult result = send_all(address, &at, 1);
    return end(result == I2cResult::kOk ? receive_all(address, out, size) : result);
  }
  /// A chip that sends a byte of zeros lets go after its ninth clock at the latest; to that chip,
  /// the high data line means no acknowledge. The stop ends any other chip's transfer.
  void recover() override {
    deadline_us_ = now_us() + kTransferUs;
    lines_.set_data(true);
    for (int i = 0; i < 9; ++i) {
      lines_.set_clock(false);
      lines_.wait();
      lines_.wait();
      raise_clock();
      lines_.wait();
    }
    lines_.set_clock(false);
    lines_.wait();
    end(I2cResult::kOk);
  }
  uint64_t now_us() override { return lines_.now_us(); }

 private:
  // Each leaves the clock low; false: the bus hangs.
  /// A start, or a repeated one. The data line of a free bus is high.
  bool begin() {
    lines_.set_data(true);
    lines_.wait();
    if (!raise_clock() || !lines_.data()) return false;
    lines_.wait();
    lines_.set_data(false);
    lines_.wait();
    lines_.set_clock(false);
    return true;
  }
  bool send(uint8_t byte, bool& is_acknowledged) {
    bool unused = false;
    for (int i = 7; i >= 0; --i)
      if (!bit((byte >> i & 1) != 0, unused)) return false;
    bool is_high = false;
    if (!bit(true, is_high)) return false;
    is_acknowledged = !is_high;
    return true;
  }
  /// The last byte is not acknowledged: the chip then sends no more.
  bool receive(uint8_t& byte, bool is_last) {
    byte = 0;
    for (int i = 0; i < 8; ++i) {
      bool is_high = false;
      if (!bit(true, is_high)) return false;
      byte = static_cast<uint8_t>(byte << 1 | (is_high ? 1 : 0));
    }
    bool unused = false;
    return bit(is_last, unused);
  }
  bool bit(bool out, bool& in) {
    lines_.set_data(out);
    lines_.wait();
    lines_.wait();
    if (!raise_clock()) return false;
    lines_.wait();
    in = lines_.data();
    lines_.set_clock(false);
    return true;
  }
  /// Lets go of the clock and waits until it is high: a chip may hold it for a while.
  bool raise_clock() {
    lines_.set_clock(true);
    while (!lines_.clock())
      if (now_us() >= deadline_us_) return false;
    return true;
  }

  I2cResult send_all(uint8_t address, const uint8_t* data, size_t size) {
    bool is_acknowledged = false;
    if (!begin() || !send(static_cast<uint8_t>(address << 1), is_acknowledged))
      return I2cResult::kHung;
    for (size_t i = 0; i < size && is_acknowledged; ++i)
      if (!send(data[i], is_acknowledged)) return I2cResult::kHung;
    return is_acknowledged ? I2cResult::kOk : I2cResult::kNoAcknowledge;
  }
  I2cResult receive_all(uint8_t address, uint8_t* out, size_t size) {
    bool is_acknowledged = false;
    if (!begin() || !send(static_cast<uint8_t>(address << 1 | 1), is_acknowledged))
      return I2cResult::kHung;
    if (!is_acknowledged) return I2cResult::kNoAcknowledge;
    for (size_t i = 0; i < size; ++i)
      if (!receive(out[i], i + 1 == size)) return I2cResult::kHung;
    return I2cResult::kOk;
  }
  /// The stop. What failed leaves a bus that is free, if a chip lets go of it.
  I2cResult end(I2cResult result) {
    lines_.set_data(false);
    lines_.wait();
    raise_clock();
    lines_.wait();
    lines_.set_data(true);
    lines_.wait();
    return result;
  }

  I2cLines& lines_;
  uint64_t deadline_us_ = 0;
};

}  // namespace wheelwire
