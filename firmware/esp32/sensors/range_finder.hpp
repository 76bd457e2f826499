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
  void add(size_t channel, const Peripheral& entry, EchoPins& pins) {
    if (count_ == kMostRanges) return;
    Sensor& sensor = sensors_[count_++];
    sensor.channel = channel;
    sensor.table = range_table_of(entry.chip);
    sensor.pins = &pins;
  }
  bool is_empty() const { return count_ == 0; }
  void poll(uint64_t now_us) {
    if (count_ == 0) return;
    if (!is_started_) return start(now_us);
    for (size_t i = 0; i < count_; ++i)
      if (!sensors_[i].pins->level()) sensors_[i].low_us = now_us;
    if (is_listening_) listen(sensors_[turn_], now_us);
    if (now_us < next_us_) return;
    turn_ = (turn_ + 1) % count_;
    begin_turn(sensors_[turn_], now_us);
  }
  /// From the control task.
  bool take(size_t channel, RangeReading& out) {
    for (size_t i = 0; i < count_; ++i)
      if (sensors_[i].channel == channel) return sensors_[i].mailbox.take(out);
    return false;
  }

 private:
  /// The sound was reflected in the middle of its way.
  static RangeReading reading_of(const EchoPulse& pulse, const RangeTable& table) {
    RangeReading reading{.state = SensorState::kOk,
                         .t_us = pulse.rise_us + pulse.length_us / 2,
                         .bound_us = kBoundUs};
    const float um = static_cast<float>(pulse.length_us) * table.um_per_us;
    const auto distance_mm = static_cast<uint32_t>(um / 1000.0f + 0.5f);
    if (pulse.length_us >= table.nothing_us || distance_mm > table.farthest_mm) {
      reading.quality = RangeQuality::kFar;
    } else if (distance_mm < table.nearest_mm) {
      reading.quality = RangeQuality::kNear;
    } else {
      reading.distance_mm = static_cast<uint16_t>(distance_mm);
    }
    return reading;
  }

  /// Of a pulse that has not ended: when it would have been is known to within what was waited for.
  static RangeReading nothing_since(uint64_t triggered_us, const RangeTable& table) {
    const uint32_t half_us = (table.start_us + table.nothing_us) / 2;
    return {.state = SensorState::kOk,
            .t_us = triggered_us + half_us,
            .bound_us = static_cast<uint16_t>(half_us),
            .quality = RangeQuality::kFar};
  }

  struct Sensor {
    size_t channel = 0;
    const RangeTable* table = nullptr;
    EchoPins* pins = nullptr;
    uint64_t low_us = 0;  // When its echo output was last seen low.
    Mailbox<RangeReading> mailbox;
  };

  /// A trigger that becomes an output may itself have started a measurement: its sound fades first.
  void start(uint64_t now_us) {
    is_started_ = true;
    for (size_t i = 0; i < count_; ++i) sensors_[i].low_us = now_us;
    turn_ = count_ - 1;
    next_us_ = now_us + sensors_[turn_].table->period_us;
  }
  /// One that is still busy loses its turn, and does not delay the others.
  void begin_turn(Sensor& sensor, uint64_t now_us) {
    next_us_ = now_us + sensor.table->period_us;
    is_listening_ = false;
    if (sensor.pins->level()) {
      if (now_us - sensor.low_us >= kHungUs)
        sensor.mailbox.post({.state = SensorState::kHung, .t_us = now_us});
      return;
    }
    is_listening_ = true;
    triggered_us_ = now_us;
    sensor.pins->trigger(sensor.table->trigger_us);
  }
  void listen(Sensor& sensor, uint64_t now_us) {
    const RangeTable& table = *sensor.table;
    // Before the pulse is asked for: one that ends in between was high.
    const bool is_high = sensor.pins->level();
    EchoPulse pulse;
    // One that began before is of what came before.
    if (sensor.pins->take(pulse) && pulse.rise_us >= triggered_us_)
      return end(sensor, reading_of(pulse, table));
    const uint64_t waited_us = now_us - triggered_us_;
    if (is_high) {
      if (waited_us >= table.start_us + table.nothing_us)
        end(sensor, nothing_since(triggered_us_, table));
    } else if (waited_us > table.start_us) {
      end(sensor, {.state = SensorState::kAbsent, .t_us = now_us});
    }
  }
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
