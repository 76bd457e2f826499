// The peripherals of a robot on a computer's own pins. What is on an I2C bus of the computer is
// read by the firmware's drivers in a process of its own, through memory that it shares with the
// one that steps the core: a transfer that the kernel does not end holds up nothing but its reader.
#pragma once

#include "i2c_sensors.hpp"
#include "sensor_port.hpp"
#include "wheelwire_core.h"

namespace wheelwire::capi {

/// Readings from the process that reads a bus to the one that steps the core, in order.
/// One side pushes, one pops, and neither waits. It may lie in memory that two processes share.
template <typename Value, uint32_t kCapacity>
class ReadingQueue {
 public:
  /// If it is full because nothing takes the values, this one is lost.
  void push(const Value& value) {
    const uint32_t end = __atomic_load_n(&end_, __ATOMIC_RELAXED);
    if (end - __atomic_load_n(&begin_, __ATOMIC_ACQUIRE) == kCapacity) return;
    values_[end % kCapacity] = value;
    __atomic_store_n(&end_, end + 1, __ATOMIC_RELEASE);
  }

  /// False if it is empty.
  bool pop(Value& out) {
    const uint32_t begin = __atomic_load_n(&begin_, __ATOMIC_RELAXED);
    if (begin == __atomic_load_n(&end_, __ATOMIC_ACQUIRE)) return false;
    out = values_[begin % kCapacity];
    __atomic_store_n(&begin_, begin + 1, __ATOMIC_RELEASE);
    return true;
  }

 private:
  static_assert((kCapacity & (kCapacity - 1)) == 0, "both indices wrap");

  Value values_[kCapacity]{};
  uint32_t begin_ = 0;
  uint32_t end_ = 0;
};

/// A bus of the computer, reached through its kernel.
class HostBus final : public I2cBus {
 public:
  /// A transfer that takes longer than this hangs.
  static constexpr int32_t kStuckUs = 100'000;

  /// Until the next call, `transfer` makes its transfers. Between transfers, now_us() is the time
  /// of the poll or of the last transfer's end. That is a moment too early, which only widens a
  /// bound.
  void begin(uint64_t now_us, wheelwire_transfer transfer, void* context) {
    now_us_ = now_us;
    transfer_ = transfer;
    context_ = context;
  }

  I2cResult write(uint8_t address, const uint8_t* data, size_t size) override {
    return carry(address, data, size, nullptr, 0);
  }
  I2cResult read(uint8_t address, uint8_t at, uint8_t* out, size_t size) override {
    return carry(address, &at, 1, out, size);
  }
  void recover() override {}  // The kernel's driver does what can be done.
  uint64_t now_us() override { return now_us_; }

  /// Called by the other process, whose step may have begun before the transfer.
  bool is_stuck(uint64_t now_us) const {
    const uint32_t since_us = __atomic_load_n(&since_us_, __ATOMIC_ACQUIRE);
    const auto age_us = static_cast<int32_t>(static_cast<uint32_t>(now_us) - since_us);
    return since_us != 0 && age_us > kStuckUs;
  }

 private:
  I2cResult carry(uint8_t address, const uint8_t* out, size_t out_size, uint8_t* in,
                  size_t in_size) {
    __atomic_store_n(&since_us_, static_cast<uint32_t>(now_us_) | 1u, __ATOMIC_RELEASE);
    uint64_t ended_us = now_us_;
    const int result = transfer_(context_, address, out, out_size, in, in_size, &ended_us);
    __atomic_store_n(&since_us_, 0u, __ATOMIC_RELEASE);
    if (ended_us > now_us_) now_us_ = ended_us;
    if (result == WHEELWIRE_TRANSFER_DONE) return I2cResult::kOk;
    return result == WHEELWIRE_TRANSFER_NO_ANSWER ? I2cResult::kNoAcknowledge : I2cResult::kHung;
  }

  uint64_t now_us_ = 0;
  wheelwire_transfer transfer_ = nullptr;
  void* context_ = nullptr;
  uint32_t since_us_ = 0;  // When the transfer that is on its way began, its last bit set; 0: none.
};

class HostSensors final : public SensorPort {
 public:
  explicit HostSensors(const PeripheralList& list) : list_(list) {
    for (size_t i = 0; i < list_.count; ++i)
      if (is_on_bus(list_.entries[i].kind)) add(i);
  }

  const PeripheralList& list() const { return list_; }

  // --- the process that reads a bus
  uint64_t poll(int number, uint64_t now_us, wheelwire_transfer transfer, void* context) {
    Bus* const bus = find(number);
    if (bus == nullptr || !__atomic_load_n(&is_asked_, __ATOMIC_ACQUIRE)) return now_us + kIdleUs;
    bus->i2c.begin(now_us, transfer, context);
    bus->chips.poll();
    for (size_t i = 0; i < list_.count; ++i) {
      pass_on(*bus, i, imus_[i]);
      pass_on(*bus, i, powers_[i]);
    }
    return bus->chips.due_us();
  }

  // --- the process that steps the core
  void begin_step(uint64_t now_us, uint16_t levels) {
    now_us_ = now_us;
    levels_ = levels;
    // Only now: nothing uses measurements from before the core's first step.
    __atomic_store_n(&is_asked_, true, __ATOMIC_RELEASE);
  }

  uint16_t levels() override { return levels_; }
  bool take(size_t channel, ImuReading& out) override { return take(channel, imus_[channel], out); }
  bool take(size_t channel, PowerReading& out) override {
    return take(channel, powers_[channel], out);
  }
  // A list that has one is refused.
  bool take(size_t, RangeReading&) override { return false; }
  bool take(size_t, AnalogReading&) override { return false; }

 private:
  /// Until the core has started.
  static constexpr uint64_t kIdleUs = 10'000;
  /// At the rate of an IMU 80 ms: a core that is silent for longer is ended.
  static constexpr uint32_t kQueue = 16;

  struct Bus {
    int number = -1;
    HostBus i2c;
    I2cSensors chips;
  };

  void add(size_t channel) {
    const Peripheral& entry = list_.entries[channel];
    Bus* bus = find(entry.pin_a);
    if (bus == nullptr) {
      bus = &buses_[bus_count_++];
      bus->number = entry.pin_a;
    }
    bus->chips.add(channel, entry, bus->i2c, nullptr);
    bus_of_[channel] = bus;
  }

  Bus* find(int number) {
    for (size_t i = 0; i < bus_count_; ++i)
      if (buses_[i].number == number) return &buses_[i];
    return nullptr;
  }

  template <typename Reading>
  void pass_on(Bus& bus, size_t channel, ReadingQueue<Reading, kQueue>& queue) {
    Reading reading;
    if (bus_of_[channel] == &bus && bus.chips.take(channel, reading)) queue.push(reading);
  }

  /// A transfer that does not end is reported once: its reader cannot.
  template <typename Reading>
  bool take(size_t channel, ReadingQueue<Reading, kQueue>& queue, Reading& out) {
    if (queue.pop(out)) {
      is_reported_[channel] = false;
      return true;
    }
    if (is_reported_[channel] || !bus_of_[channel]->i2c.is_stuck(now_us_)) return false;
    is_reported_[channel] = true;
    out = {.state = SensorState::kHung, .t_us = now_us_};
    return true;
  }

  PeripheralList list_;
  Bus buses_[kMostPeripherals];
  size_t bus_count_ = 0;
  Bus* bus_of_[kMostPeripherals]{};
  ReadingQueue<ImuReading, kQueue> imus_[kMostPeripherals];
  ReadingQueue<PowerReading, kQueue> powers_[kMostPeripherals];
  bool is_reported_[kMostPeripherals]{};
  bool is_asked_ = false;
  uint16_t levels_ = 0;
  uint64_t now_us_ = 0;
};

}  // namespace wheelwire::capi
