#include "range_sensors.hpp"

#include <cmath>

#include "board.hpp"

namespace wheelwire::sim {

namespace {

constexpr uint32_t kPollUs = I2cSensors::kPollUs;
/// Time from the trigger to the pulse, with the burst and what comes before it.
constexpr uint64_t kBurstUs = 450;
/// The pulse where nothing reflects the sound, and what is too far away to be heard.
constexpr uint32_t kNoEchoUs = 38'000;
constexpr double kDeafBeyondM = 4.5;

}  // namespace

void SimulatedRangeSensor::trigger(uint32_t us) {
  if (!answers() || world_.hung) return;
  const double distance_m = world_.distance_m[static_cast<size_t>(entry_.place)];
  const double um_per_us = static_cast<double>(range_table_of(entry_.chip)->um_per_us);
  const bool is_heard = distance_m <= kDeafBeyondM;
  pulse_ = {.rise_us = board_.device_us() + us + kBurstUs,
            .length_us = is_heard ? static_cast<uint32_t>(std::lround(distance_m * 1e6 / um_per_us))
                                  : kNoEchoUs};
  has_pulse_ = true;
}

/// Its plug is in, and the board that is wired leaves its pins to it.
bool SimulatedRangeSensor::answers() const {
  return !world_.absent && board_.is_free(entry_.pin_a) && board_.is_free(entry_.pin_b);
}

bool SimulatedRangeSensor::has_ended() const {
  return board_.device_us() >= pulse_.rise_us + pulse_.length_us;
}

bool SimulatedRangeSensor::level() {
  if (!answers()) return false;
  return world_.hung || (has_pulse_ && board_.device_us() >= pulse_.rise_us && !has_ended());
}

bool SimulatedRangeSensor::take(EchoPulse& out) {
  if (!answers() || world_.hung || !has_pulse_ || !has_ended()) return false;
  has_pulse_ = false;
  out = pulse_;
  return true;
}

void RangeSensors::take_up(const PeripheralList& list) {
  finder = {};
  sensors_.clear();
  next_poll_us_ = 0;
  for (size_t i = 0; i < list.count; ++i)
    if (list.entries[i].kind == PeripheralKind::kRange)
      finder.add(i, list.entries[i], sensors_.emplace_back(list.entries[i], world, board_));
}

void RangeSensors::poll() {
  if (finder.is_empty()) return;
  const uint64_t now_us = board_.device_us();
  if (now_us < next_poll_us_) return;
  finder.poll(now_us);
  next_poll_us_ = (now_us / kPollUs + 1) * kPollUs;
}

}  // namespace wheelwire::sim
