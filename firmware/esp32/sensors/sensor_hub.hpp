// What a board's peripherals measure, whether it can be used, and what it forbids. Called once in
// each control step; asks no chip and waits for nothing.
#pragma once

#include "battery_guard.hpp"
#include "latches.hpp"
#include "peripherals.hpp"
#include "sensor_port.hpp"

namespace wheelwire {

/// Called within `update`.
class SensorObserver {
 public:
  virtual void on_sensor_event(SensorEventCode code, size_t channel, uint16_t value,
                               uint64_t now_us) = 0;
  virtual void on_reading(size_t channel, const ImuReading& reading, uint16_t sample) = 0;
  virtual void on_reading(size_t channel, const RangeReading& reading, uint16_t sample) = 0;

 protected:
  ~SensorObserver() = default;
};

class SensorHub {
 public:
  /// A sensor that was not read within this after the start is not only unread: it is missing.
  static constexpr uint64_t kFirstReadUs = 1'000'000;
  /// An input that was triggered is free again when it was free for this long: a switch bounces.
  static constexpr uint64_t kReleaseUs = 50'000;
  /// A battery divider that reads 0 mV for this long counts as broken.
  static constexpr uint64_t kZeroUs = 100'000;
  /// Time from one reading to the next, at most half of what makes a sensor stale.
  static constexpr uint32_t kImuPeriodUs = 5'000;
  static constexpr uint32_t kPowerPeriodUs = 100'000;
  static constexpr uint32_t kAnalogPeriodUs = 100'000;

  explicit SensorHub(SensorObserver& observer) : observer_(observer) {}

  /// Reads these from now on; both must outlive it.
  void start(SensorPort& port, const PeripheralList& list) {
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

  /// Before the first `update`: the battery was at STOP before the reset, and stays there until it
  /// was charged. A list without its levels keeps that for the next one.
  void start_at_stop() {
    is_at_stop_ = true;
    if (guards_battery()) battery_.start_at_stop();
  }

  /// Reads all. Returns what is forbidden until the next call, as flags of `reflex`, with
  /// kBatteryAtStop.
  /// `divider_mv`: of the battery, by the board's divider; 0: it is not measured.
  uint8_t update(uint16_t divider_mv, uint64_t now_us) {
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

  const PeripheralList& list() const { return *list_; }
  SensorState state(size_t channel) const { return channels_[channel].state; }
  /// Identity of a wrong chip in its place; 0: no wrong chip.
  uint16_t identity(size_t channel) const { return channels_[channel].identity; }
  uint8_t reflexes() const { return reflexes_; }
  /// Which of them hold the robot, as flags of `held`. Call it after the first `update`.
  uint32_t held() const {
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
  uint16_t levels() const { return levels_; }
  /// The inputs that act on the robot: bit n is channel n.
  uint16_t triggered() const { return triggered_; }
  uint16_t stale() const {
    uint16_t channels = 0;
    for (size_t i = 0; i < list_->count; ++i)
      if (channels_[i].state != SensorState::kOk) channels |= bit(i);
    return channels;
  }
  /// Level of a digital input; 0 for others.
  uint16_t edges(size_t channel) const {
    return (inputs_ >> channel & 1) != 0 ? channels_[channel].count : uint16_t{0};
  }
  BatteryLevel battery_level() const { return battery_.level(); }
  /// Voltage from the power sensor, or from the divider.
  const PowerReading& power() const { return power_; }
  /// Drawn since the start, as far as the power sensor measured it.
  float used_mah() const {
    constexpr float kMicrosecondsPerHour = 3.6e9f;
    return static_cast<float>(used_ma_us_) / kMicrosecondsPerHour;
  }
  /// The channel whose Power is sent; -1: none.
  int power_channel() const { return power_channel_; }
  /// Time from one measurement of a range sensor to its next.
  uint32_t range_round_us() const { return range_round_us_; }
  /// Voltage before the divider, by the input's index; 0: missing or unusable.
  uint16_t analog_mv(size_t index) const { return analog_mv_[index]; }

 private:
  static constexpr uint16_t bit(size_t channel) { return static_cast<uint16_t>(1u << channel); }

  static int find(const PeripheralList& list, PeripheralKind kind) {
    for (size_t i = 0; i < list.count; ++i)
      if (list.entries[i].kind == kind) return static_cast<int>(i);
    return -1;
  }

  /// Flag of `held`.
  static uint32_t held_by(const Peripheral& entry) {
    if (entry.kind == PeripheralKind::kStageFault) return held::kFaultInput;
    if (entry.kind != PeripheralKind::kBumper) return held::kCliff;
    static_assert(held::kBumperRearRight == held::kBumperFront << 5 && Place::kFront == Place{1} &&
                  Place::kRearRight == Place{6});
    return held::kBumperFront << (static_cast<unsigned>(entry.place) -
                                  static_cast<unsigned>(Place::kFront));
  }

  struct Channel {
    SensorState state = SensorState::kUnread;
    uint16_t identity = 0;
    uint16_t count = 0;  // Samples of an IMU or a range sensor, edges of an input.
    uint64_t seen_us = 0;
  };

  void read_inputs(uint64_t now_us) {
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
  /// False if it gave nothing new, which is judged here.
  template <typename Reading>
  bool take(size_t channel, Reading& out, uint32_t period_us, uint64_t now_us) {
    if (port_->take(channel, out)) return true;
    note_state(channel, overdue(channel, period_us, now_us), now_us, identity(channel));
    return false;
  }
  void read_imu(size_t channel, uint64_t now_us) {
    ImuReading reading;
    if (!take(channel, reading, kImuPeriodUs, now_us)) return;
    // Where steps are farther apart than samples each step takes several.
    do {
      if (!note_state(channel, reading.state, now_us, reading.identity)) continue;
      channels_[channel].seen_us = now_us;
      observer_.on_reading(channel, reading, ++channels_[channel].count);
    } while (port_->take(channel, reading));
  }
  void read_power(size_t channel, uint64_t now_us) {
    PowerReading reading;
    if (!take(channel, reading, kPowerPeriodUs, now_us)) return;
    const bool was_measured = channels_[channel].state == SensorState::kOk;
    if (!note_state(channel, reading.state, now_us, reading.identity)) return;
    channels_[channel].seen_us = now_us;
    // The charge drawn before the first reading, or between failed ones, is unknown.
    if (was_measured)
      used_ma_us_ += reading.current_ma * static_cast<int64_t>(reading.t_us - power_.t_us);
    power_ = reading;
  }
  void read_range(size_t channel, uint64_t now_us) {
    RangeReading reading;
    if (!take(channel, reading, range_round_us_, now_us)) return;
    if (!note_state(channel, reading.state, now_us)) return;
    channels_[channel].seen_us = now_us;
    observer_.on_reading(channel, reading, ++channels_[channel].count);
  }
  /// 0 mV is a voltage as any other: what is connected may well have none.
  void read_analog(size_t channel, uint64_t now_us) {
    const Peripheral& entry = list_->entries[channel];
    uint16_t& millivolts = analog_mv_[analog_index(entry)];
    AnalogReading reading;
    if (!take(channel, reading, kAnalogPeriodUs, now_us)) {
      if (state(channel) != SensorState::kOk) millivolts = 0;
      return;
    }
    note_state(channel, SensorState::kOk, now_us);
    channels_[channel].seen_us = now_us;
    const uint32_t whole_mv = uint32_t{reading.pin_mv} * entry.value_a / 1000;
    millivolts = static_cast<uint16_t>(whole_mv < UINT16_MAX ? whole_mv : UINT16_MAX);
  }
  void read_battery(size_t channel, uint16_t divider_mv, uint64_t now_us) {
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
  /// True if its newest reading can be used.
  bool note_state(size_t channel, SensorState state, uint64_t now_us, uint16_t identity = 0) {
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
  /// The state of a sensor that gave nothing new.
  SensorState overdue(size_t channel, uint32_t period_us, uint64_t now_us) const {
    const Channel& known = channels_[channel];
    if (known.state == SensorState::kUnread)
      return now_us - start_us_ < kFirstReadUs ? SensorState::kUnread : SensorState::kMissed;
    // A late step is not a sensor's fault, so the step before must have found nothing, either.
    const bool is_late = known.state == SensorState::kOk && known.seen_us < updated_us_ &&
                         now_us - known.seen_us > 2 * period_us;
    return is_late ? SensorState::kMissed : known.state;
  }
  uint8_t reflex_of(const Peripheral& entry) const {
    if (entry.kind != PeripheralKind::kBumper) return reflex::kStop;
    if (is_front(entry.place)) return reflex::kNoForward;
    return reflex::kNoReverse;
  }
  bool guards_battery() const {
    return battery_channel_ >= 0 && is_guarded(list_->entries[battery_channel_]);
  }

  SensorObserver& observer_;
  SensorPort* port_ = nullptr;
  const PeripheralList* list_ = nullptr;
  bool started_ = false;
  uint8_t reflexes_ = reflex::kUnread;
  uint16_t inputs_ = 0;  // Channels that are digital inputs,
  uint16_t low_ = 0;     // and those that trigger at the low level.
  uint16_t levels_ = 0;
  uint16_t triggered_ = 0;
  uint64_t start_us_ = 0;
  uint64_t updated_us_ = 0;  // The update before this one.
  Channel channels_[kMostPeripherals];
  uint32_t range_round_us_ = 0;
  uint16_t analog_mv_[kMostAnalog]{};
  int power_channel_ = -1;
  int battery_channel_ = -1;
  PowerReading power_;
  int64_t used_ma_us_ = 0;  // A sum of floats would lose small currents after a day.
  BatteryGuard battery_;
  bool is_at_stop_ = false;
};

}  // namespace wheelwire
