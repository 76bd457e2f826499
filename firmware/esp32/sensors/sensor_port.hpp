// What the firmware reads of a board's peripherals. A test can inject a fault into any of it.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "protocol.hpp"

namespace wheelwire {

/// One reading of an IMU, in its chip's axes and counts.
struct ImuReading {
  SensorState state = SensorState::kUnread;  ///< If not kOk, only the time is valid.
  uint64_t t_us = 0;                         ///< Device clock when it was measured...
  uint16_t bound_us = 0;                     ///< ... plus or minus this.
  int16_t gyro[3]{};
  int16_t accelerometer[3]{};
  int16_t temperature_cdeg = 0;
  uint16_t identity = 0;  ///< Identity of a wrong chip in its place; 0: no wrong chip.
};

/// One reading of a power sensor.
struct PowerReading {
  SensorState state = SensorState::kUnread;  ///< If not kOk, only the time is valid.
  uint64_t t_us = 0;
  uint16_t voltage_mv = 0;
  int32_t current_ma = 0;
  uint16_t identity = 0;  ///< As an IMU's.
};

/// One measurement of a range sensor.
struct RangeReading {
  SensorState state = SensorState::kUnread;  ///< If not kOk, only the time is valid.
  uint64_t t_us = 0;                         ///< Device clock when the sound was reflected...
  uint16_t bound_us = 0;                     ///< ... plus or minus this.
  uint16_t distance_mm = 0;                  ///< Valid if the quality is GOOD.
  RangeQuality quality = RangeQuality::kGood;
};

/// One reading of an analogue input. A failed one is not a reading: it must not mean 0 mV.
struct AnalogReading {
  uint16_t pin_mv = 0;  ///< Behind the divider.
};

/// A board's peripherals. Digital inputs are read at once; the rest is read by tasks of its own,
/// which nothing that hangs can make the control task wait for.
class SensorPort {
 public:
  /// The levels at the pins of the digital inputs: bit n is channel n.
  virtual uint16_t levels() = 0;
  /// Takes the newest reading of the channel since the last call; false: there is none.
  virtual bool take(size_t channel, ImuReading& out) = 0;
  virtual bool take(size_t channel, PowerReading& out) = 0;
  virtual bool take(size_t channel, RangeReading& out) = 0;
  virtual bool take(size_t channel, AnalogReading& out) = 0;

 protected:
  ~SensorPort() = default;
};

}  // namespace wheelwire
