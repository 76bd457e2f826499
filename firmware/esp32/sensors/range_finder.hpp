// Range sensors that answer a trigger with a pulse as long as the sound's way there and back. They
// measure in turn: the sound of one would be the echo of another.
#pragma once

#include "mailbox.hpp"
#include "peripherals.hpp"
#include "sensor_port.hpp"

namespace wheelwire {

/// A pulse at an echo output, by the device clock.
struct EchoPulse {
  uint64_t rise_us = 0;
  uint32_t length_us = 0;
};

/// The two pins of a range sensor.
class EchoPins {
 public:
  /// Holds the trigger high for this long. Only this function waits.
  virtual void trigger(uint32_t us) = 0;
  /// The present level of the echo output.
  virtual bool level() = 0;
  /// The newest pulse of the echo output that has ended since the last call; false: none has.
  virtual bool take(EchoPulse& out) = 0;

 protected:
  ~EchoPins() = default;
};

/// All of a board's. Polled by the sensors' task, about once a millisecond: the edges of a pulse
/// have their time from the hardware.
class RangeFinder {
 public:
  /// An echo output that stays high longer will not fall any more. Some parts keep it high for a
  /// fifth of a second where nothing reflects the sound.
  static constexpr uint64_t kHungUs = 250'000;
  /// The burst has 200 us, and the edges may be late.
  static constexpr uint16_t kBoundUs = 250;

  /// Call it before the first poll; `pins` must outlive it.
  void add(size_t channel, const Peripheral& entry, EchoPins& pins);
  bool is_empty() const { return count_ == 0; }
  void poll(uint64_t now_us);
  /// From the control task.
  bool take(size_t channel, RangeReading& out);

 private:
  struct Sensor {
    size_t channel = 0;
    const RangeTable* table = nullptr;
    EchoPins* pins = nullptr;
    uint64_t low_us = 0;  // When its echo output was last seen low.
    Mailbox<RangeReading> mailbox;
  };

  void start(uint64_t now_us);
  void begin_turn(Sensor& sensor, uint64_t now_us);
  void listen(Sensor& sensor, uint64_t now_us);
  void end(Sensor& sensor, const RangeReading& reading) {
    is_listening_ = false;
    sensor.mailbox.post(reading);
  }

  Sensor sensors_[kMostRanges];
  size_t count_ = 0;
  size_t turn_ = 0;  // Whose turn it is.
  bool is_started_ = false;
  bool is_listening_ = false;
  uint64_t triggered_us_ = 0;
  uint64_t next_us_ = 0;  // When the next turn begins.
};

}  // namespace wheelwire
