#include "sensor_server.hpp"

namespace wheelwire {
namespace {

constexpr uint64_t kSecondUs = 1'000'000;
constexpr uint64_t kInputsPeriodUs = kSecondUs;
/// Inputs that chatter do not fill the line.
constexpr uint64_t kLeastInputsUs = 20'000;
constexpr uint16_t kPowerHz = 2;
/// What an analogue input moves by at its pin before it has changed.
constexpr int kAnalogStepMv = 50;

/// Rate of all range sensors together: they measure in turn.
uint32_t range_bytes_per_second(const PeripheralList& list) {
  uint32_t count = 0;
  for (const Peripheral& entry : list)
    if (entry.kind == PeripheralKind::kRange) ++count;
  if (count == 0) return 0;
  const uint32_t rate_hz = count * static_cast<uint32_t>(kSecondUs) / range_round_us(list) + 1;
  return rate_hz * static_cast<uint32_t>(frame_size(Range::kSize));
}

}  // namespace

SensorServer::SensorServer(const PeripheralList& list, SensorPort* port, BatterySense* divider)
    : divider_(divider), is_active_(port != nullptr && list.count != 0) {
  if (is_active_) hub_.start(*port, list);
}

// --- requests ------------------------------------------------------------------------------------

void SensorServer::serve(const Frame& frame, uint16_t request_id, uint64_t now_us) {
  server_->conclude(frame.id, request_id, RefusalCode::kNone);
  streams_ = {};
  if (!is_active_) return;
  streams_.asked_hz = streams_.imu_hz = SensorStream::decode(frame.body).rate_hz;
  streams_.infos_left = hub_.list().count;
  streams_.next_power_us = now_us;
  const uint32_t interval_us = server_->state_interval_us();
  fit_to_line(interval_us == 0 ? 0 : static_cast<uint32_t>(kSecondUs) / interval_us, now_us);
}

// --- what is sent unasked ------------------------------------------------------------------------

/// The states come first, and ranges, which are few: what they leave of the line is the IMU's, and
/// so much less of it is sent.
void SensorServer::fit_to_line(uint32_t state_hz, uint64_t now_us) {
  if (streams_.asked_hz == 0) return;
  const size_t taken =
      state_hz * frame_size(WheelState::kSize) + range_bytes_per_second(hub_.list());
  const uint32_t imu_hz =
      server_->link().rate_beside(static_cast<uint32_t>(taken), Imu::kSize, streams_.asked_hz);
  if (imu_hz == streams_.imu_hz) return;
  streams_.imu_hz = static_cast<uint16_t>(imu_hz);
  if (imu_hz == streams_.asked_hz) return;
  for (size_t i = 0; i < hub_.list().count; ++i)
    if (hub_.list().entries[i].kind == PeripheralKind::kImu)
      on_sensor_event(SensorEventCode::kReduced, i, streams_.imu_hz, now_us);
}

void SensorServer::stream(uint64_t now_us) {
  // One in a step: all at once might not fit into the line's buffer.
  if (streams_.infos_left != 0) send_info(--streams_.infos_left, now_us);
  if (streams_.asked_hz == 0) return;
  send_inputs(now_us);
  send_power(now_us);
}

void SensorServer::send_info(size_t channel, uint64_t now_us) {
  const Peripheral& entry = hub_.list().entries[channel];
  SensorInfo info{.session_id = server_->session_id(),
                  .channel = static_cast<uint8_t>(channel),
                  .channel_count = hub_.list().count,
                  .kind = entry.kind,
                  .chip = entry.chip,
                  .place = entry.place,
                  .forward = entry.forward,
                  .up = entry.up,
                  .state = hub_.state(channel)};
  // The host takes an IMU's bias off, and knows an analogue input by its number.
  if (entry.kind == PeripheralKind::kImu || entry.kind == PeripheralKind::kAnalog) {
    info.bias_x = static_cast<int16_t>(entry.value_a);
    info.bias_y = static_cast<int16_t>(entry.value_b);
    info.bias_z = static_cast<int16_t>(entry.value_c);
  }
  const ImuTable* const table = imu_table_of(entry.chip);
  if (entry.kind == PeripheralKind::kImu && table != nullptr) {
    info.rate_hz = streams_.imu_hz;
    info.gyro_scale = table->gyro_radps;
    info.accelerometer_scale = table->accelerometer_mps2;
    info.gyro_noise = table->gyro_noise * table->gyro_radps;
    info.accelerometer_noise = table->accelerometer_noise * table->accelerometer_mps2;
  } else if (entry.kind == PeripheralKind::kRange) {
    info.rate_hz = static_cast<uint16_t>(kSecondUs / hub_.range_round_us());
  } else if (static_cast<int>(channel) == hub_.power_channel()) {
    info.rate_hz = kPowerHz;
  }
  server_->link().send(info);
  if (hub_.identity(channel) != 0)
    on_sensor_event(SensorEventCode::kIdentity, channel, hub_.identity(channel), now_us);
}

void SensorServer::send_power(uint64_t now_us) {
  const int channel = hub_.power_channel();
  if (channel < 0 || now_us < streams_.next_power_us) return;
  if (hub_.state(static_cast<size_t>(channel)) != SensorState::kOk) return;
  streams_.next_power_us = now_us + kSecondUs / kPowerHz;
  const PowerReading& power = hub_.power();
  server_->link().send(Power{.boot_id = server_->boot_id(),
                             .t_us = static_cast<uint32_t>(power.t_us),
                             .channel = static_cast<uint8_t>(channel),
                             .voltage_mv = power.voltage_mv,
                             .current_ma = power.current_ma,
                             .used_mah = hub_.used_mah(),
                             .level = hub_.battery_level()});
}

void SensorServer::send_inputs(uint64_t now_us) {
  const Inputs digital = digital_inputs();
  const bool changed = digital != streams_.digital || has_analog_moved();
  if (now_us < (changed ? streams_.inputs_us + kLeastInputsUs : streams_.next_inputs_us)) return;
  streams_.digital = digital;
  for (size_t i = 0; i < kMostAnalog; ++i) streams_.analog_mv[i] = hub_.analog_mv(i);
  streams_.inputs_us = now_us;
  streams_.next_inputs_us = now_us + kInputsPeriodUs;
  Inputs inputs = digital;
  inputs.t_us = static_cast<uint32_t>(now_us);
  inputs.analog_1_mv = streams_.analog_mv[0];
  inputs.analog_2_mv = streams_.analog_mv[1];
  inputs.analog_3_mv = streams_.analog_mv[2];
  inputs.analog_4_mv = streams_.analog_mv[3];
  server_->link().send(inputs);
}

Inputs SensorServer::digital_inputs() const {
  return {.boot_id = server_->boot_id(),
          .levels = hub_.levels(),
          .triggered = hub_.triggered(),
          .stale = hub_.stale(),
          .reflexes = hub_.reflexes(),
          .level = hub_.battery_level(),
          .edges_0 = hub_.edges(0),
          .edges_1 = hub_.edges(1),
          .edges_2 = hub_.edges(2),
          .edges_3 = hub_.edges(3),
          .edges_4 = hub_.edges(4),
          .edges_5 = hub_.edges(5),
          .edges_6 = hub_.edges(6),
          .edges_7 = hub_.edges(7),
          .edges_8 = hub_.edges(8),
          .edges_9 = hub_.edges(9)};
}

/// By more than what an ADC's readings tremble.
bool SensorServer::has_analog_moved() const {
  for (const Peripheral& entry : hub_.list()) {
    if (entry.kind != PeripheralKind::kAnalog) continue;
    const int moved_mv =
        hub_.analog_mv(analog_index(entry)) - streams_.analog_mv[analog_index(entry)];
    if ((moved_mv < 0 ? -moved_mv : moved_mv) * 1000 >= kAnalogStepMv * entry.value_a) return true;
  }
  return false;
}

void SensorServer::on_sensor_event(SensorEventCode code, size_t channel, uint16_t value,
                                   uint64_t now_us) {
  if (streams_.asked_hz == 0) return;
  server_->link().send(SensorEvent{.boot_id = server_->boot_id(),
                                   .t_us = static_cast<uint32_t>(now_us),
                                   .channel = static_cast<uint8_t>(channel),
                                   .code = code,
                                   .value = value});
}

void SensorServer::on_reading(size_t channel, const ImuReading& reading, uint16_t sample) {
  if (streams_.imu_hz == 0 || reading.t_us < streams_.next_imu_us) return;
  // If all samples are wanted, a chip with a fast clock must not lose any.
  const uint64_t interval_us = kSecondUs / streams_.imu_hz;
  streams_.next_imu_us = reading.t_us + interval_us - interval_us / 16;
  server_->link().send(Imu{.boot_id = server_->boot_id(),
                           .t_us = static_cast<uint32_t>(reading.t_us),
                           .channel = static_cast<uint8_t>(channel),
                           .sample = sample,
                           .bound_us = reading.bound_us,
                           .gyro_x = reading.gyro[0],
                           .gyro_y = reading.gyro[1],
                           .gyro_z = reading.gyro[2],
                           .accelerometer_x = reading.accelerometer[0],
                           .accelerometer_y = reading.accelerometer[1],
                           .accelerometer_z = reading.accelerometer[2],
                           .temperature_cdeg = reading.temperature_cdeg});
}

void SensorServer::on_reading(size_t channel, const RangeReading& reading, uint16_t sample) {
  if (streams_.asked_hz == 0) return;
  server_->link().send(Range{.boot_id = server_->boot_id(),
                             .t_us = static_cast<uint32_t>(reading.t_us),
                             .channel = static_cast<uint8_t>(channel),
                             .sample = sample,
                             .bound_us = reading.bound_us,
                             .distance_mm = reading.distance_mm,
                             .quality = reading.quality});
}

}  // namespace wheelwire
