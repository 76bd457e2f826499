#include "sensors.hpp"

#include <algorithm>
#include <cmath>

#include "board.hpp"

namespace wheelwire::sim {

void Sensors::take_up(const PeripheralList& list) {
  list_ = list;
  chips.take_up(list);
  ranges.take_up(list);
  analog_ = {};
  next_analog_us_ = 0;
}

/// One task asks both the chips on buses and the range sensors: a bus that hangs keeps it busy.
void Sensors::advance(bool is_running) {
  chips.advance(is_running);
  if (!is_running) return;
  if (board_.device_us() >= chips.busy_until_us()) ranges.poll();
  measure_analog();
}

void Sensors::measure_analog() {
  if (board_.device_us() < next_analog_us_) return;
  next_analog_us_ = board_.device_us() + SensorHub::kAnalogPeriodUs;
  if (analog_failed) return;
  for (size_t i = 0; i < list_.count; ++i)
    if (list_.entries[i].kind == PeripheralKind::kAnalog)
      analog_[i].post({.pin_mv = pin_mv(list_.entries[i])});
}

/// The ADC reads at most this, at any voltage. 0 if another wire is at the pin.
uint16_t Sensors::pin_mv(const Peripheral& entry) const {
  constexpr double kMostMv = 3100.0;
  if (!board_.is_free(entry.pin_a)) return 0;
  const double whole_mv = analog_v[analog_index(entry)] * 1e3;
  return static_cast<uint16_t>(std::lround(std::min(kMostMv, whole_mv * 1e3 / entry.value_a)));
}

bool Sensors::is_triggered(const Peripheral& entry) const {
  const auto place = static_cast<size_t>(entry.place);
  switch (entry.kind) {
    case PeripheralKind::kBumper:
      return bumpers[place];
    case PeripheralKind::kCliff:
      return cliffs[place];
    default:
      return stage_fault;
  }
}

uint16_t Sensors::levels() {
  uint16_t levels = 0;
  for (size_t i = 0; i < list_.count; ++i) {
    const Peripheral& entry = list_.entries[i];
    if (!is_digital_input(entry.kind)) continue;
    const bool low_triggers = (entry.flags & peripheralflag::kTriggeredLow) != 0;
    // What is open is high.
    const bool is_high = !board_.is_free(entry.pin_a) || is_triggered(entry) != low_triggers;
    if (is_high) levels |= static_cast<uint16_t>(1u << i);
  }
  return levels;
}

}  // namespace wheelwire::sim
