// An I2C bus, of which this chip is the only controller. Called from the sensors' task only.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire {

enum class I2cResult : uint8_t {
  kOk,
  kNoAcknowledge,  ///< No chip answers at this address.
  kHung,           ///< A line is held low, or the transfer did not end in time.
};

class I2cBus {
 public:
  /// A transfer that takes longer is given up: several times what the longest one takes.
  static constexpr uint32_t kTransferUs = 5'000;

  virtual I2cResult write(uint8_t address, const uint8_t* data, size_t size) = 0;
  /// Reads registers from `at` upwards, at once.
  virtual I2cResult read(uint8_t address, uint8_t at, uint8_t* out, size_t size) = 0;
  /// Nine clocks and a stop: a chip that was interrupted while it sent a byte lets go of the data
  /// line.
  virtual void recover() = 0;
  /// The device clock. It goes on during a transfer.
  virtual uint64_t now_us() = 0;

 protected:
  ~I2cBus() = default;
};

}  // namespace wheelwire
