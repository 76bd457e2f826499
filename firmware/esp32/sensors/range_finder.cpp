#include "range_finder.hpp"

namespace wheelwire {
namespace {

/// The sound was reflected in the middle of its way.
RangeReading reading_of(const EchoPulse& pulse, const RangeTable& table) {
  RangeReading reading{.state = SensorState::kOk,
                       .t_us = pulse.rise_us + pulse.length_us / 2,
                       .bound_us = RangeFinder::kBoundUs};
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
RangeReading nothing_since(uint64_t triggered_us, const RangeTable& table) {
  const uint32_t half_us = (table.start_us + table.nothing_us) / 2;
  return {.state = SensorState::kOk,
          .t_us = triggered_us + half_us,
          .bound_us = static_cast<uint16_t>(half_us),
          .quality = RangeQuality::kFar};
}

}  // namespace

void RangeFinder::add(size_t channel, const Peripheral& entry, EchoPins& pins) {
  if (count_ == kMostRanges) return;
  Sensor& sensor = sensors_[count_++];
  sensor.channel = channel;
  sensor.table = range_table_of(entry.chip);
  sensor.pins = &pins;
}

bool RangeFinder::take(size_t channel, RangeReading& out) {
  for (size_t i = 0; i < count_; ++i)
    if (sensors_[i].channel == channel) return sensors_[i].mailbox.take(out);
  return false;
}

void RangeFinder::poll(uint64_t now_us) {
  if (count_ == 0) return;
  if (!is_started_) return start(now_us);
  for (size_t i = 0; i < count_; ++i)
    if (!sensors_[i].pins->level()) sensors_[i].low_us = now_us;
  if (is_listening_) listen(sensors_[turn_], now_us);
  if (now_us < next_us_) return;
  turn_ = (turn_ + 1) % count_;
  begin_turn(sensors_[turn_], now_us);
}

/// A trigger that becomes an output may itself have started a measurement: its sound fades first.
void RangeFinder::start(uint64_t now_us) {
  is_started_ = true;
  for (size_t i = 0; i < count_; ++i) sensors_[i].low_us = now_us;
  turn_ = count_ - 1;
  next_us_ = now_us + sensors_[turn_].table->period_us;
}

/// One that is still busy loses its turn, and does not delay the others.
void RangeFinder::begin_turn(Sensor& sensor, uint64_t now_us) {
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

void RangeFinder::listen(Sensor& sensor, uint64_t now_us) {
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

}  // namespace wheelwire
