#include "sensor_hub.hpp"

namespace wheelwire {
namespace {

constexpr uint16_t bit(size_t channel) { return static_cast<uint16_t>(1u << channel); }

int find(const PeripheralList& list, PeripheralKind kind) {
  for (size_t i = 0; i < list.count; ++i)
    if (list.entries[i].kind == kind) return static_cast<int>(i);
  return -1;
}

/// Flag of `held`.
uint32_t held_by(const Peripheral& entry) {
  if (entry.kind == PeripheralKind::kStageFault) return held::kFaultInput;
  if (entry.kind != PeripheralKind::kBumper) return held::kCliff;
  static_assert(held::kBumperRearRight == held::kBumperFront << 5 && Place::kFront == Place{1} &&
                Place::kRearRight == Place{6});
  return held::kBumperFront << (static_cast<unsigned>(entry.place) -
                                static_cast<unsigned>(Place::kFront));
}

}  // namespace

void SensorHub::start(SensorPort& port, const PeripheralList& list) {
  port_ = &port;
  list_ = &list;
  range_round_us_ = wheelwire::range_round_us(list);
  power_channel_ = find(list, PeripheralKind::kPower);
  battery_channel_ = find(list, PeripheralKind::kBattery);
  if (battery_channel_ >= 0) battery_.start(list.entries[battery_channel_]);
  // A power sensor measures the battery, also on a board with a divider.
  if (power_channel_ < 0) power_channel_ = battery_channel_;
  for (size_t i = 0; i < list.count; ++i) {
    if (!is_digital_input(list.entries[i].kind)) continue;
    inputs_ |= bit(i);
    if ((list.entries[i].flags & peripheralflag::kTriggeredLow) != 0) low_ |= bit(i);
  }
}

void SensorHub::start_at_stop() {
  is_at_stop_ = true;
  if (guards_battery()) battery_.start_at_stop();
}

bool SensorHub::guards_battery() const {
  return battery_channel_ >= 0 && is_guarded(list_->entries[battery_channel_]);
}

uint8_t SensorHub::update(uint16_t divider_mv, uint64_t now_us) {
  if (!started_) {
    started_ = true;
    start_us_ = now_us;
    for (Channel& channel : channels_) channel.seen_us = now_us;
    levels_ = static_cast<uint16_t>(port_->levels() & inputs_);
  }
  read_inputs(now_us);
  for (size_t i = 0; i < list_->count; ++i) {
    switch (list_->entries[i].kind) {
      case PeripheralKind::kImu:
        read_imu(i, now_us);
        break;
      case PeripheralKind::kPower:
        read_power(i, now_us);
        break;
      case PeripheralKind::kRange:
        read_range(i, now_us);
        break;
      case PeripheralKind::kAnalog:
        read_analog(i, now_us);
        break;
      default:
        break;
    }
  }
  updated_us_ = now_us;
  // After the power sensor, which may be what measures it.
  if (battery_channel_ >= 0)
    read_battery(static_cast<size_t>(battery_channel_), divider_mv, now_us);
  uint8_t forbidden = 0;
  bool is_stage_tripped = false;
  for (size_t i = 0; i < list_->count; ++i) {
    if (!(triggered_ & bit(i))) continue;
    if (list_->entries[i].kind == PeripheralKind::kStageFault)
      is_stage_tripped = true;
    else
      forbidden |= reflex_of(list_->entries[i]);
  }
  if (guards_battery()) {
    is_at_stop_ = battery_level() == BatteryLevel::kStop;
    const SensorState state = channels_[battery_channel_].state;
    if (state == SensorState::kUnread) {
      forbidden |= reflex::kUnread;
    } else if (state != SensorState::kOk || is_at_stop_) {
      forbidden |= reflex::kStop;
    } else if (battery_level() == BatteryLevel::kLimit) {
      forbidden |= reflex::kLimit;
    }
  }
  uint8_t beside = is_at_stop_ ? kBatteryAtStop : uint8_t{0};
  if (is_stage_tripped && (forbidden & reflex::kStop) == 0) {
    forbidden |= reflex::kStop;
    beside |= kStageTripped;
  }
  reflexes_ = forbidden;
  return forbidden | beside;
}

uint32_t SensorHub::held() const {
  uint32_t flags = 0;
  for (size_t i = 0; i < list_->count; ++i)
    if ((triggered_ & bit(i)) != 0) flags |= held_by(list_->entries[i]);
  if (!guards_battery()) return flags;
  const SensorState state = channels_[battery_channel_].state;
  if (battery_level() == BatteryLevel::kStop) {
    flags |= held::kBattery;
  } else if (state != SensorState::kOk && state != SensorState::kUnread) {
    flags |= held::kBatteryUnknown;
  }
  return flags;
}

uint8_t SensorHub::reflex_of(const Peripheral& entry) const {
  if (entry.kind != PeripheralKind::kBumper) return reflex::kStop;
  if (is_front(entry.place)) return reflex::kNoForward;
  return reflex::kNoReverse;
}

void SensorHub::read_inputs(uint64_t now_us) {
  if (inputs_ == 0) return;
  const auto levels = static_cast<uint16_t>(port_->levels() & inputs_);
  const uint16_t changed = levels ^ levels_;
  levels_ = levels;
  const uint16_t active = (levels ^ low_) & inputs_;
  for (size_t i = 0; i < list_->count; ++i) {
    if (!(inputs_ & bit(i))) continue;
    Channel& channel = channels_[i];
    channel.state = SensorState::kOk;  // It was read in this very step.
    if (changed & bit(i)) ++channel.count;
    if (active & bit(i)) channel.seen_us = now_us;
    const bool was_triggered = (triggered_ & bit(i)) != 0;
    // Immediately when it triggers; with a delay when it is free again.
    const bool triggers =
        (active & bit(i)) || (was_triggered && now_us - channel.seen_us < kReleaseUs);
    if (triggers == was_triggered) continue;
    triggered_ ^= bit(i);
    observer_.on_sensor_event(triggers ? SensorEventCode::kTriggered : SensorEventCode::kReleased,
                              i, reflex_of(list_->entries[i]), now_us);
  }
}

SensorState SensorHub::overdue(size_t channel, uint32_t period_us, uint64_t now_us) const {
  const Channel& known = channels_[channel];
  if (known.state == SensorState::kUnread)
    return now_us - start_us_ < kFirstReadUs ? SensorState::kUnread : SensorState::kMissed;
  // A late step is not a sensor's fault, so the step before must have found nothing, either.
  const bool is_late = known.state == SensorState::kOk && known.seen_us < updated_us_ &&
                       now_us - known.seen_us > 2 * period_us;
  return is_late ? SensorState::kMissed : known.state;
}

/// True if its newest reading can be used.
bool SensorHub::note_state(size_t channel, SensorState state, uint64_t now_us, uint16_t identity) {
  Channel& known = channels_[channel];
  if (state != known.state) {
    known.state = state;
    observer_.on_sensor_event(SensorEventCode::kState, channel, static_cast<uint16_t>(state),
                              now_us);
  }
  if (identity != known.identity) {
    known.identity = identity;
    if (identity != 0)
      observer_.on_sensor_event(SensorEventCode::kIdentity, channel, identity, now_us);
  }
  return state == SensorState::kOk;
}

void SensorHub::read_imu(size_t channel, uint64_t now_us) {
  ImuReading reading;
  if (!port_->take(channel, reading)) {
    note_state(channel, overdue(channel, kImuPeriodUs, now_us), now_us, identity(channel));
    return;
  }
  // Where steps are farther apart than samples each step takes several.
  do {
    if (!note_state(channel, reading.state, now_us, reading.identity)) continue;
    channels_[channel].seen_us = now_us;
    observer_.on_reading(channel, reading, ++channels_[channel].count);
  } while (port_->take(channel, reading));
}

void SensorHub::read_power(size_t channel, uint64_t now_us) {
  PowerReading reading;
  if (!port_->take(channel, reading)) {
    note_state(channel, overdue(channel, kPowerPeriodUs, now_us), now_us, identity(channel));
    return;
  }
  const bool was_measured = channels_[channel].state == SensorState::kOk;
  if (!note_state(channel, reading.state, now_us, reading.identity)) return;
  channels_[channel].seen_us = now_us;
  // The charge drawn before the first reading, or between failed ones, is unknown.
  if (was_measured)
    used_ma_us_ += reading.current_ma * static_cast<int64_t>(reading.t_us - power_.t_us);
  power_ = reading;
}

float SensorHub::used_mah() const {
  constexpr float kMicrosecondsPerHour = 3.6e9f;
  return static_cast<float>(used_ma_us_) / kMicrosecondsPerHour;
}

void SensorHub::read_range(size_t channel, uint64_t now_us) {
  RangeReading reading;
  if (!port_->take(channel, reading)) {
    note_state(channel, overdue(channel, range_round_us_, now_us), now_us);
    return;
  }
  if (!note_state(channel, reading.state, now_us)) return;
  channels_[channel].seen_us = now_us;
  observer_.on_reading(channel, reading, ++channels_[channel].count);
}

/// 0 mV is a voltage as any other: what is connected may well have none.
void SensorHub::read_analog(size_t channel, uint64_t now_us) {
  const Peripheral& entry = list_->entries[channel];
  uint16_t& millivolts = analog_mv_[analog_index(entry)];
  AnalogReading reading;
  if (!port_->take(channel, reading)) {
    if (!note_state(channel, overdue(channel, kAnalogPeriodUs, now_us), now_us)) millivolts = 0;
    return;
  }
  note_state(channel, SensorState::kOk, now_us);
  channels_[channel].seen_us = now_us;
  const uint32_t whole_mv = uint32_t{reading.pin_mv} * entry.value_a / 1000;
  millivolts = static_cast<uint16_t>(whole_mv < UINT16_MAX ? whole_mv : UINT16_MAX);
}

void SensorHub::read_battery(size_t channel, uint16_t divider_mv, uint64_t now_us) {
  Channel& battery = channels_[channel];
  const bool is_divided = power_channel_ == battery_channel_;
  if (!is_divided) {
    const SensorState state = channels_[power_channel_].state;
    const bool is_zero = state == SensorState::kOk && power_.voltage_mv == 0;
    note_state(channel, is_zero ? SensorState::kZero : state, now_us);
  } else if (divider_mv != 0) {
    battery.seen_us = now_us;
    note_state(channel, SensorState::kOk, now_us);
    power_ = {.state = SensorState::kOk, .t_us = now_us, .voltage_mv = divider_mv};
  } else if (battery.state == SensorState::kUnread) {
    if (now_us - start_us_ >= kFirstReadUs) note_state(channel, SensorState::kZero, now_us);
  } else if (now_us - battery.seen_us >= kZeroUs) {
    note_state(channel, SensorState::kZero, now_us);
  }
  if (battery.state != SensorState::kOk) return battery_.rest(now_us);
  const uint16_t millivolts = is_divided ? divider_mv : power_.voltage_mv;
  // A divider's 0 mV is not a battery voltage, even before it has lasted.
  if (millivolts == 0 || !guards_battery()) return;
  if (!battery_.update(millivolts, now_us)) return;
  observer_.on_sensor_event(SensorEventCode::kBattery, channel,
                            static_cast<uint16_t>(battery_level()), now_us);
}

uint16_t SensorHub::stale() const {
  uint16_t channels = 0;
  for (size_t i = 0; i < list_->count; ++i)
    if (channels_[i].state != SensorState::kOk) channels |= bit(i);
  return channels;
}

}  // namespace wheelwire
