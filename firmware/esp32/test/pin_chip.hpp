// A chip on an I2C bus that sees nothing but the levels of its two lines.
#pragma once

#include <cstdint>
#include <vector>

namespace wheelwire::test {

/// Registers that are written and read by the bus. It pulls the data line low, never the clock.
class PinChip {
 public:
  static constexpr uint8_t kAddress = 0x68;

  uint8_t registers[256]{};
  bool pulls_data = false;
  std::vector<uint8_t> unacknowledged;  ///< What it was sent that was not for it.
  int starts = 0;
  int stops = 0;

  void follow(bool clock, bool data) {
    if (clock && clock_ && data_ && !data) start();
    if (clock && clock_ && !data_ && data) stop();
    if (clock && !clock_) rise(data);
    if (!clock && clock_) fall();
    clock_ = clock;
    data_ = data;
  }

 private:
  enum class Phase { kIdle, kAddress, kRegister, kWrite, kRead };

  void start() {
    ++starts;
    phase_ = Phase::kAddress;
    bits_ = 0;
    byte_ = 0;
    pulls_data = false;
  }
  void stop() {
    ++stops;
    phase_ = Phase::kIdle;
    pulls_data = false;
  }
  void rise(bool data) {
    if (phase_ == Phase::kIdle) return;
    if (bits_ < 8) byte_ = static_cast<uint8_t>(byte_ << 1 | (data ? 1 : 0));
    // The controller's acknowledge, of what it reads.
    if (bits_ == 8 && phase_ == Phase::kRead && data) phase_ = Phase::kIdle;
    ++bits_;
  }
  void fall() {
    pulls_data = false;
    if (bits_ == 9) bits_ = 0;
    if (phase_ == Phase::kIdle) return;
    if (bits_ == 8) take_byte();
    if (bits_ == 0 && phase_ == Phase::kRead) sending_ = registers[at_++];
    if (bits_ < 8 && phase_ == Phase::kRead) pulls_data = !(sending_ >> (7 - bits_) & 1);
  }
  /// Between its eighth and ninth bit.
  void take_byte() {
    switch (phase_) {
      case Phase::kAddress:
        if (byte_ >> 1 != kAddress) {
          unacknowledged.push_back(byte_);
          phase_ = Phase::kIdle;
          return;
        }
        phase_ = byte_ & 1 ? Phase::kRead : Phase::kRegister;
        break;
      case Phase::kRegister:
        at_ = byte_;
        phase_ = Phase::kWrite;
        break;
      case Phase::kWrite:
        registers[at_++] = byte_;
        break;
      default:
        return;  // It is read: the acknowledge is the controller's.
    }
    pulls_data = true;
  }

  Phase phase_ = Phase::kIdle;
  bool clock_ = true;
  bool data_ = true;
  int bits_ = 0;
  uint8_t byte_ = 0;
  uint8_t at_ = 0;
  uint8_t sending_ = 0;
};

}  // namespace wheelwire::test
