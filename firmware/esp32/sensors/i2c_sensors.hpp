// The chips on I2C buses: IMUs and power sensors, by their tables. Their own task reads them,
// because a hung bus costs its reader milliseconds. The control task takes the readings from a
// mailbox and never waits.
#pragma once

#include "i2c_bus.hpp"
#include "mailbox.hpp"
#include "peripherals.hpp"
#include "sensor_hub.hpp"

namespace wheelwire {

/// The data-ready output of a chip.
class DataReady {
 public:
  /// The device clock at its newest edge; 0: there was none.
  virtual uint64_t edge_us() = 0;

 protected:
  ~DataReady() = default;
};

/// One chip on a bus. A transfer that fails is repeated once: noise from the motors spoils single
/// ones.
class I2cChip {
 public:
  I2cChip() = default;
  I2cChip(I2cBus& bus, uint8_t address) : bus_(&bus), address_(address) {}

  I2cResult write(const uint8_t* data, size_t size);
  I2cResult read(uint8_t at, uint8_t* out, size_t size);
  uint64_t now_us() const { return bus_->now_us(); }

 private:
  template <typename Transfer>
  I2cResult with_repeat(Transfer transfer);

  I2cBus* bus_ = nullptr;
  uint8_t address_ = 0;
};

/// After a failure a chip is tried again so much later.
constexpr uint64_t kI2cRetryUs = 100'000;
/// Samples within this time after the set-up are not used: gyroscopes start, filters settle, the
/// first conversion of a power sensor ends.
constexpr uint64_t kI2cSettleUs = 100'000;
/// After a longer read, the time of the measurement is unknown. This is longer than two transfers
/// may take.
constexpr uint64_t kI2cLongestReadUs = 4 * uint64_t{I2cBus::kTransferUs};

/// What the drivers of all chips have in common.
template <typename Reading>
class I2cDriver {
 public:
  /// Called by another task: takes the newest reading since the last call; false: there is none.
  bool take(Reading& out) { return mailbox_.take(out); }
  /// Before this there is nothing to do.
  uint64_t due_us() const { return next_us_; }

 protected:
  I2cDriver() = default;
  explicit I2cDriver(const I2cChip& chip) : chip_(chip) {}

  void post(const Reading& reading) { mailbox_.post(reading); }
  /// False if it was not kOk.
  bool succeeded(I2cResult result) {
    if (result == I2cResult::kOk) return true;
    fail(result == I2cResult::kHung ? SensorState::kHung : SensorState::kAbsent);
    return false;
  }
  /// Lost settings are written again at once: the chip then has time to settle.
  void fail(SensorState state, uint16_t identity = 0) {
    const uint64_t now_us = chip_.now_us();
    post({.state = state, .t_us = now_us, .identity = identity});
    is_ready_ = false;
    next_us_ = state == SensorState::kReset ? now_us : now_us + kI2cRetryUs;
  }

  I2cChip chip_;
  uint64_t next_us_ = 0;
  bool is_ready_ = false;  // Identified and set up.

 private:
  Mailbox<Reading> mailbox_;
};

/// Reads each sample once: when the data-ready output says so, or as soon as a sample differs from
/// the one before. Noise of more than one count, on six axes, makes two equal ones the same one.
class ImuDriver : public I2cDriver<ImuReading> {
 public:
  /// Time from one sample to the next, at the rates in the tables.
  static constexpr uint32_t kPeriodUs = SensorHub::kImuPeriodUs;
  /// Without a data-ready output: time from one look at the chip to the next, once a sample is
  /// expected.
  static constexpr uint32_t kLookUs = 1'000;
  /// How late the time of an edge may be.
  static constexpr uint16_t kEdgeBoundUs = 50;

  ImuDriver() = default;
  /// `ready`: nullptr if it is not connected. All must outlive the driver.
  ImuDriver(const ImuTable& table, const I2cChip& chip, DataReady* ready)
      : I2cDriver(chip), table_(&table), ready_(ready) {}

  bool exists() const { return table_ != nullptr; }
  /// Does what is due. Takes some I2cBus::kTransferUs at worst.
  void poll();

 private:
  static constexpr size_t kMostBytes = 16;
  /// Within this time after an edge, no chip's clock is fast enough for the next sample.
  static constexpr uint32_t kFreshUs = kPeriodUs - kPeriodUs / 10;

  void set_up(uint64_t now_us);
  bool has_new_edge(uint64_t now_us);
  void look_for_cause(uint64_t now_us);
  void read_sample();
  bool is_repeated(const uint8_t* raw) const;
  /// How long a sample may stay the newest one before the chip counts as frozen.
  /// The first of so many equal samples was seen when it was new. Half a period is left to clocks.
  uint64_t frozen_us() const { return (table_->frozen_samples - 1u) * kPeriodUs + kPeriodUs / 2; }
  /// False if the chip has lost them, or does not say so.
  bool check_settings();
  void post_sample(const uint8_t* raw, uint64_t began_us, uint64_t ended_us);
  int16_t number(const uint8_t* raw, size_t at) const;

  const ImuTable* table_ = nullptr;
  DataReady* ready_ = nullptr;
  bool has_settings_ = false;  // They were written, and nothing says that they were lost.
  bool has_raw_ = false;
  uint8_t raw_[kMostBytes]{};  // The newest sample.
  uint64_t changed_us_ = 0;    // When it was first seen.
  uint64_t looked_us_ = 0;     // When the chip was last read; 0: not since it was set up.
  uint64_t edge_us_ = 0;       // Of the edge that was last seen.
};

/// A steady voltage is not a fault: a power sensor never counts as frozen.
class PowerDriver : public I2cDriver<PowerReading> {
 public:
  static constexpr uint32_t kPeriodUs = SensorHub::kPowerPeriodUs;

  PowerDriver() = default;
  PowerDriver(const PowerTable& table, const I2cChip& chip, uint16_t shunt_100uohm)
      : I2cDriver(chip), table_(&table), shunt_100uohm_(shunt_100uohm) {}

  bool exists() const { return table_ != nullptr; }
  void poll();

 private:
  void set_up(uint64_t now_us);
  void read_sample();
  bool read_register(uint8_t at, uint16_t& out);

  const PowerTable* table_ = nullptr;
  uint16_t shunt_100uohm_ = 0;
};

/// All of a board's, by channel.
class I2cSensors {
 public:
  /// Time from one poll to the next, unless one takes longer.
  static constexpr uint32_t kPollUs = ImuDriver::kLookUs;

  /// An IMU or a power sensor; call it before the first poll. `ready`: see ImuDriver.
  void add(size_t channel, const Peripheral& entry, I2cBus& bus, DataReady* ready);
  /// Looks at all chips, or ends after one that hung; the next call goes on behind it. So lower
  /// tasks get their turn in between: the task watchdog waits for less than all chips may take.
  void poll();
  /// When the next poll has something to do, if there is no data-ready output.
  uint64_t due_us() const;
  // From the control task.
  bool take(size_t channel, ImuReading& out) { return imus_[channel].take(out); }
  bool take(size_t channel, PowerReading& out) { return powers_[channel].take(out); }

 private:
  ImuDriver imus_[kMostPeripherals];
  PowerDriver powers_[kMostPeripherals];
  I2cBus* clock_ = nullptr;  // Any bus: all have the device clock. nullptr: no chip was added.
  size_t next_ = 0;          // The channel that the next round begins with.
};

}  // namespace wheelwire
