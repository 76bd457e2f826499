#include "i2c_sensors.hpp"

#include <string.h>

namespace wheelwire {
namespace {

constexpr size_t kAxesSize = 6;  // Three numbers.

constexpr uint64_t middle(uint64_t began_us, uint64_t ended_us) {
  return began_us + (ended_us - began_us) / 2;
}

constexpr int16_t big_endian(const uint8_t* bytes) {
  return static_cast<int16_t>(bytes[0] << 8 | bytes[1]);
}

constexpr int16_t little_endian(const uint8_t* bytes) {
  return static_cast<int16_t>(bytes[1] << 8 | bytes[0]);
}

}  // namespace

// --- a chip --------------------------------------------------------------------------------------

template <typename Transfer>
I2cResult I2cChip::with_repeat(Transfer transfer) {
  const I2cResult result = transfer();
  if (result == I2cResult::kOk) return result;
  if (result == I2cResult::kHung) bus_->recover();
  return transfer();
}

I2cResult I2cChip::write(const uint8_t* data, size_t size) {
  return with_repeat([&] { return bus_->write(address_, data, size); });
}

I2cResult I2cChip::read(uint8_t at, uint8_t* out, size_t size) {
  return with_repeat([&] { return bus_->read(address_, at, out, size); });
}

// --- an IMU --------------------------------------------------------------------------------------

namespace {

bool has_identity(const ImuTable& table, uint8_t identity) {
  return identity == table.identities[0] || identity == table.identities[1];
}

/// The table of the chip that answers. Modules of one name carry several chips, each with its own
/// filters and thermometer. nullptr: this chip is not sold under that name.
const ImuTable* table_of(const ImuTable& wanted, uint8_t identity) {
  if (has_identity(wanted, identity)) return &wanted;
  for (const ImuTable& table : kImuTables)
    if (table.address == wanted.address && table.identity_register == wanted.identity_register &&
        has_identity(table, identity))
      return &table;
  return nullptr;
}

}  // namespace

void ImuDriver::poll() {
  const uint64_t now_us = chip_.now_us();
  if (now_us < next_us_) return;
  if (!is_ready_) return set_up(now_us);
  if (ready_ == nullptr || has_new_edge(now_us)) read_sample();
}

/// Settings that were written once, and are still there, are left alone: no sample is lost to a
/// single fault of the bus.
void ImuDriver::set_up(uint64_t now_us) {
  uint8_t identity = 0;
  if (!succeeded(chip_.read(table_->identity_register, &identity, 1))) return;
  const ImuTable* const found = table_of(*table_, identity);
  if (found == nullptr) return fail(SensorState::kAbsent, identity);
  if (found != table_) has_settings_ = false;
  table_ = found;
  if (has_settings_) {
    if (!check_settings()) return;
    next_us_ = now_us;
  } else {
    for (size_t i = 0; i < table_->setup_count; ++i) {
      const uint8_t write[] = {table_->setup[i].at, table_->setup[i].value};
      if (!succeeded(chip_.write(write, sizeof write))) return;
    }
    has_settings_ = true;
    next_us_ = now_us + kI2cSettleUs;
  }
  is_ready_ = true;
  changed_us_ = next_us_;
  looked_us_ = 0;
}

bool ImuDriver::has_new_edge(uint64_t now_us) {
  const uint64_t edge_us = ready_->edge_us();
  const bool is_new = edge_us != edge_us_;
  edge_us_ = edge_us;
  if (!is_new && now_us - changed_us_ >= 2 * kPeriodUs) look_for_cause(now_us);
  return is_new;
}

/// Why no edge comes. A chip that lost its settings may sleep; the output of another stays high
/// until the sample is read, which is then too old to be used.
void ImuDriver::look_for_cause(uint64_t now_us) {
  next_us_ = now_us + kPeriodUs;
  uint8_t raw[kMostBytes];
  if (succeeded(chip_.read(table_->data_register, raw, table_->size))) check_settings();
}

void ImuDriver::read_sample() {
  uint8_t raw[kMostBytes]{};
  const uint64_t began_us = chip_.now_us();
  if (!succeeded(chip_.read(table_->data_register, raw, table_->size))) return;
  const uint64_t ended_us = chip_.now_us();
  if (ended_us - began_us > kI2cLongestReadUs) return;
  // The next sample came before this one was read, so it is unknown which one this is.
  if (ready_ != nullptr && (ready_->edge_us() != edge_us_ || ended_us - edge_us_ >= kFreshUs))
    return;
  // After the read: what was measured with other settings is not used.
  if (!check_settings()) return;
  if (is_repeated(raw)) {
    next_us_ = began_us + kLookUs;
    looked_us_ = began_us;
    if (began_us - changed_us_ < frozen_us()) return;
    has_settings_ = false;
    return fail(SensorState::kFrozen);
  }
  next_us_ = ready_ != nullptr ? began_us : began_us + kPeriodUs - kLookUs;
  post_sample(raw, began_us, ended_us);
  memcpy(raw_, raw, sizeof raw_);
  has_raw_ = true;
  changed_us_ = looked_us_ = began_us;
}

/// Temperature is left out: it goes on where a gyroscope is stuck.
bool ImuDriver::is_repeated(const uint8_t* raw) const {
  const auto equal = [&](size_t at) { return memcmp(raw + at, raw_ + at, kAxesSize) == 0; };
  return has_raw_ && equal(table_->gyro) && equal(table_->accelerometer);
}

bool ImuDriver::check_settings() {
  uint8_t value = 0;
  if (!succeeded(chip_.read(table_->check_register, &value, 1))) return false;
  if (value == table_->check_value) return true;
  has_settings_ = false;
  fail(SensorState::kReset);
  return false;
}

/// Without an edge it was measured after the last look at the chip, or at most one period ago.
void ImuDriver::post_sample(const uint8_t* raw, uint64_t began_us, uint64_t ended_us) {
  ImuReading reading{.state = SensorState::kOk, .t_us = edge_us_, .bound_us = kEdgeBoundUs};
  if (ready_ == nullptr) {
    reading.t_us = middle(began_us, ended_us);
    const uint64_t since_look_us = began_us - looked_us_;
    const uint64_t age_us = since_look_us < kPeriodUs ? since_look_us : kPeriodUs;
    reading.bound_us = static_cast<uint16_t>(age_us + (reading.t_us - began_us) + 1);
  }
  for (size_t i = 0; i < 3; ++i) {
    reading.gyro[i] = number(raw, table_->gyro + 2 * i);
    reading.accelerometer[i] = number(raw, table_->accelerometer + 2 * i);
  }
  const float degrees =
      static_cast<float>(number(raw, table_->temperature)) / table_->temperature_counts;
  reading.temperature_cdeg =
      static_cast<int16_t>(table_->temperature_offset_cdeg + static_cast<int>(degrees * 100.0f));
  post(reading);
}

int16_t ImuDriver::number(const uint8_t* raw, size_t at) const {
  return table_->is_big_endian ? big_endian(raw + at) : little_endian(raw + at);
}

// --- a power sensor ------------------------------------------------------------------------------

void PowerDriver::poll() {
  const uint64_t now_us = chip_.now_us();
  if (now_us < next_us_) return;
  if (is_ready_) {
    read_sample();
  } else {
    set_up(now_us);
  }
}

/// One without an identity is known by its configuration, which has bits that do not change.
void PowerDriver::set_up(uint64_t now_us) {
  const uint8_t write[] = {0, static_cast<uint8_t>(table_->setup >> 8),
                           static_cast<uint8_t>(table_->setup)};
  uint16_t identity = 0;
  if (!succeeded(chip_.write(write, sizeof write))) return;
  if (!read_register(table_->identity_register, identity)) return;
  if (identity != table_->identity) return fail(SensorState::kAbsent, identity);
  is_ready_ = true;
  next_us_ = now_us + kI2cSettleUs;
}

void PowerDriver::read_sample() {
  const uint64_t began_us = chip_.now_us();
  next_us_ = began_us + kPeriodUs;
  uint16_t bus = 0;
  uint16_t shunt = 0;
  uint16_t setup = 0;
  if (!read_register(table_->bus_register, bus) || !read_register(1, shunt)) return;
  const uint64_t ended_us = chip_.now_us();
  if (ended_us - began_us > kI2cLongestReadUs) return;
  // After the read: what was measured with other settings is not used.
  if (!read_register(0, setup)) return;
  if (setup != table_->setup) return fail(SensorState::kReset);
  const uint32_t bus_uv = (uint32_t{bus} >> table_->bus_shift) * table_->bus_uv;
  // Nanovolts through microohms are milliamperes.
  const int32_t shunt_nv = static_cast<int16_t>(shunt) * int32_t{table_->shunt_nv};
  post({.state = SensorState::kOk,
        .t_us = middle(began_us, ended_us),
        .voltage_mv = static_cast<uint16_t>(bus_uv / 1000),
        .current_ma = shunt_nv / (int32_t{shunt_100uohm_} * 100)});
}

bool PowerDriver::read_register(uint8_t at, uint16_t& out) {
  uint8_t bytes[2];
  if (!succeeded(chip_.read(at, bytes, sizeof bytes))) return false;
  out = static_cast<uint16_t>(big_endian(bytes));
  return true;
}

// --- all -----------------------------------------------------------------------------------------

void I2cSensors::add(size_t channel, const Peripheral& entry, I2cBus& bus, DataReady* ready) {
  const I2cChip chip{bus, address_of(entry)};
  clock_ = &bus;
  if (entry.kind == PeripheralKind::kImu)
    imus_[channel] = ImuDriver{*imu_table_of(entry.chip), chip, ready};
  if (entry.kind == PeripheralKind::kPower)
    powers_[channel] = PowerDriver{*power_table_of(entry.chip), chip, entry.value_a};
}

void I2cSensors::poll() {
  if (clock_ == nullptr) return;
  const uint64_t end_us = clock_->now_us() + I2cBus::kTransferUs;
  for (size_t i = 0; i < kMostPeripherals && clock_->now_us() < end_us; ++i) {
    if (imus_[next_].exists()) imus_[next_].poll();
    if (powers_[next_].exists()) powers_[next_].poll();
    next_ = (next_ + 1) % kMostPeripherals;
  }
}

uint64_t I2cSensors::due_us() const {
  uint64_t due_us = UINT64_MAX;
  const auto look = [&due_us](const auto& driver) {
    if (driver.exists() && driver.due_us() < due_us) due_us = driver.due_us();
  };
  for (const ImuDriver& imu : imus_) look(imu);
  for (const PowerDriver& power : powers_) look(power);
  return due_us;
}

}  // namespace wheelwire
