// The chips of a board on their I2C buses, register by register, and the firmware's task that reads
// them. It runs between control steps: a bus that hangs keeps it busy, and the steps go on.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>

#include "clock.hpp"
#include "i2c_sensors.hpp"
#include "plant.hpp"
#include "random.hpp"

namespace wheelwire::sim {

class SimulatedBoard;

/// A chip at its address.
class I2cTarget {
 public:
  virtual ~I2cTarget() = default;
  virtual void write(const uint8_t* data, size_t size) = 0;
  virtual void read(uint8_t at, uint8_t* out, size_t size) = 0;
};

/// What an IMU's variables set.
struct ImuFaults {
  double bias_radps = 0.0;  ///< Of the yaw rate.
  double noise = 1.0;       ///< Relative to the chip's own.
  bool freeze = false;      ///< It repeats its newest sample.
  bool absent = false;      ///< Its plug is off.
  int identity = 0;         ///< The identity that it reports; 0: the chip that the board names.
  bool bus_hung = false;
  bool interrupt_lost = false;  ///< The wire of its data-ready output is off.
  /// The axes that point forward and up, codes of Axis. Unless both are given, and are not on one
  /// line, it is mounted as the board says.
  int forward = -1;
  int up = -1;
};

/// Measures what the plant does, averaged from one sample to the next.
class SimulatedImu final : public I2cTarget, public DataReady {
 public:
  SimulatedImu(const Peripheral& entry, const ImuFaults& faults, uint64_t seed, Nanoseconds now);

  void write(const uint8_t* data, size_t size) override;
  void read(uint8_t at, uint8_t* out, size_t size) override;
  uint64_t edge_us() override { return edge_us_; }

  /// As after a dip of its supply: it sleeps, and has lost its settings.
  void lose_settings();
  /// Takes a sample if one is due.
  void advance(const SimulatedBoard& board);

 private:
  using Vector = std::array<double, 3>;
  /// The robot's motion at a sample, from which the next one is computed.
  struct Motion {
    double heading_rad = 0.0;
    double speed_mps = 0.0;
    Tilt tilt;
  };

  bool measures() const;
  Nanoseconds period() const;
  void sample(const Plant& plant, double period_s);
  /// Converts from the robot's axes, forward, left and up, to the chip's.
  Vector mounted(const Vector& robot) const;
  void store(uint8_t offset, double counts);
  double noise();

  const ImuTable& table_;
  const ImuFaults& faults_;
  Vector forward_;
  Vector up_;
  Random random_;
  std::array<uint8_t, 256> registers_{};
  Nanoseconds next_ = 0;
  uint64_t edge_us_ = 0;
  // At the last sample.
  Nanoseconds last_ = 0;
  Motion motion_;
};

/// Measures the motors' supply at the time of the read.
class SimulatedPowerSensor final : public I2cTarget {
 public:
  SimulatedPowerSensor(const Peripheral& entry, const SimulatedBoard& board);

  void write(const uint8_t* data, size_t size) override;
  void read(uint8_t at, uint8_t* out, size_t size) override;
  /// As after a dip of its supply.
  void lose_settings() { setup_ = 0; }

 private:
  uint16_t value_of(uint8_t at) const;

  const PowerTable& table_;
  const SimulatedBoard& board_;
  double shunt_ohm_;
  uint16_t setup_ = 0;
};

/// The time that a task has spent since it was woken.
struct TaskClock {
  uint64_t woken_us = 0;
  uint64_t spent_us = 0;
};

class SimulatedBus final : public I2cBus {
 public:
  SimulatedBus(const Peripheral& entry, TaskClock& clock)
      : data_pin_(entry.pin_a), clock_pin_(entry.pin_b), clock_(clock) {}

  /// A line is held low. nullptr: none ever is.
  const bool* is_hung = nullptr;

  /// Whether the board that is wired leaves its pins to it.
  void look(const SimulatedBoard& board);
  bool is_of(const Peripheral& entry) const {
    return entry.pin_a == data_pin_ && entry.pin_b == clock_pin_;
  }
  /// It answers as long as `is_absent` is false.
  void add(uint8_t address, I2cTarget& target, const bool& is_absent) {
    chips_.push_back({address, target, is_absent});
  }

  I2cResult write(uint8_t address, const uint8_t* data, size_t size) override;
  I2cResult read(uint8_t address, uint8_t at, uint8_t* out, size_t size) override;
  void recover() override { clock_.spent_us += kRecoverUs; }
  uint64_t now_us() override { return clock_.woken_us + clock_.spent_us; }

 private:
  /// A byte with its acknowledge takes nine clocks of 2.5 us.
  static constexpr double kByteUs = 22.5;
  static constexpr uint64_t kRecoverUs = 50;

  struct Chip {
    uint8_t address;
    I2cTarget& target;
    const bool& is_absent;
  };

  /// Of so many bytes with the chip at this address, which `act(chip)` ends.
  template <typename Act>
  I2cResult transfer(uint8_t address, size_t bytes, Act act);

  int data_pin_;
  int clock_pin_;
  TaskClock& clock_;
  bool is_wired_ = true;
  std::deque<Chip> chips_;
};

class I2cChips {
 public:
  I2cChips(const SimulatedBoard& board, uint64_t seed) : board_(board), seed_(seed) {}
  I2cChips(const I2cChips&) = delete;
  I2cChips& operator=(const I2cChips&) = delete;

  ImuFaults imu;
  bool power_absent = false;
  I2cSensors sensors;  ///< The firmware's.

  /// The firmware starts with this list. A chip that was there before keeps its settings.
  void take_up(const PeripheralList& list);
  /// After each step of the physics. `is_running`: the firmware's task does.
  void advance(bool is_running);
  void reset_imus();
  void reset_power_sensors();
  /// Until then the firmware's task is busy with them, by the device clock.
  uint64_t busy_until_us() const { return clock_.woken_us + clock_.spent_us; }

 private:
  void wire(const PeripheralList& list);
  SimulatedBus& bus_of(const Peripheral& entry);

  const SimulatedBoard& board_;
  uint64_t seed_;
  PeripheralList list_;
  bool has_chips_ = false;
  TaskClock clock_;
  std::deque<SimulatedBus> buses_;
  std::array<std::optional<SimulatedImu>, kMostPeripherals> imus_;
  std::array<std::optional<SimulatedPowerSensor>, kMostPeripherals> power_sensors_;
  uint64_t next_poll_us_ = 0;
};

}  // namespace wheelwire::sim
