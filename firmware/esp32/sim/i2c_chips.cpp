#include "i2c_chips.hpp"

#include <algorithm>
#include <cmath>

#include "board.hpp"

namespace wheelwire::sim {

namespace {

constexpr double kTemperatureCdeg = 3000;  // In a housing with motors.

std::array<double, 3> unit_vector(Axis axis) {
  std::array<double, 3> vector{};
  const auto code = static_cast<size_t>(axis);
  vector[code % 3] = code < 3 ? 1.0 : -1.0;
  return vector;
}

/// As a tilted robot sees it.
std::array<double, 3> tilted(const std::array<double, 3>& level, const Tilt& tilt) {
  const double sin_roll = std::sin(tilt.roll_rad);
  const double cos_roll = std::cos(tilt.roll_rad);
  const double sin_pitch = std::sin(tilt.pitch_rad);
  const double cos_pitch = std::cos(tilt.pitch_rad);
  const double up = level[0] * sin_pitch + level[2] * cos_pitch;
  return {level[0] * cos_pitch - level[2] * sin_pitch, level[1] * cos_roll + up * sin_roll,
          up * cos_roll - level[1] * sin_roll};
}

int16_t saturated(double counts) {
  return static_cast<int16_t>(std::lround(std::clamp(counts, -32768.0, 32767.0)));
}

}  // namespace

// --- an IMU --------------------------------------------------------------------------------------

SimulatedImu::SimulatedImu(const Peripheral& entry, const ImuFaults& faults, uint64_t seed,
                           Nanoseconds now)
    : table_(*imu_table_of(entry.chip)),
      faults_(faults),
      forward_(unit_vector(entry.forward)),
      up_(unit_vector(entry.up)),
      random_(seed),
      next_(now + period()),
      last_(now) {
  lose_settings();
}

void SimulatedImu::lose_settings() {
  registers_.fill(0);
  registers_[table_.identity_register] = table_.identities[0];
}

void SimulatedImu::write(const uint8_t* data, size_t size) {
  for (size_t i = 1; i < size; ++i) registers_[static_cast<uint8_t>(data[0] + i - 1)] = data[i];
}

void SimulatedImu::read(uint8_t at, uint8_t* out, size_t size) {
  for (size_t i = 0; i < size; ++i) out[i] = registers_[static_cast<uint8_t>(at + i)];
  if (faults_.identity != 0 && at == table_.identity_register)
    out[0] = static_cast<uint8_t>(faults_.identity);
}

/// It sleeps until it has all its settings: only its table's settings are simulated.
bool SimulatedImu::measures() const {
  return std::all_of(table_.setup, table_.setup + table_.setup_count,
                     [this](RegisterWrite write) { return registers_[write.at] == write.value; });
}

Nanoseconds SimulatedImu::period() const { return 1'000'000'000 / table_.rate_hz; }

void SimulatedImu::advance(const SimulatedBoard& board) {
  if (board.now() < next_) return;
  const Plant& plant = board.plant;
  if (faults_.absent) lose_settings();
  if (measures()) {
    if (!faults_.freeze) sample(plant, static_cast<double>(board.now() - last_) * 1e-9);
    if (!faults_.interrupt_lost) edge_us_ = board.device_us();
  }
  last_ = board.now();
  motion_ = {.heading_rad = plant.pose().heading_rad,
             .speed_mps = plant.forward_mps(),
             .tilt = plant.tilt()};
  next_ += period();
}

void SimulatedImu::sample(const Plant& plant, double period_s) {
  const double slope = plant.model().slope_rad;
  const double heading = plant.pose().heading_rad;
  const Tilt& tilt = plant.tilt();
  const double yaw_radps = (heading - motion_.heading_rad) / period_s;
  const double roll_radps = (tilt.roll_rad - motion_.tilt.roll_rad) / period_s;
  const double pitch_radps = (tilt.pitch_rad - motion_.tilt.pitch_rad) / period_s;
  const double uphill = kGravity * std::sin(slope);
  // The robot rolls about its own axis, and pitches about one that is level.
  Vector turn = tilted({0.0, 0.0, yaw_radps}, tilt);
  turn[0] += roll_radps;
  turn[1] += pitch_radps * std::cos(tilt.roll_rad);
  turn[2] += faults_.bias_radps - pitch_radps * std::sin(tilt.roll_rad);
  // What carries the robot, and what turns it, pushes the chip, too.
  const Vector push{
      (plant.forward_mps() - motion_.speed_mps) / period_s + uphill * std::cos(heading),
      plant.forward_mps() * yaw_radps - uphill * std::sin(heading), kGravity * std::cos(slope)};
  const Vector gyro = mounted(turn);
  const Vector accelerometer = mounted(tilted(push, tilt));
  for (uint8_t i = 0; i < 3; ++i) {
    const auto offset = static_cast<uint8_t>(2 * i);
    store(table_.gyro + offset, gyro[i] / table_.gyro_radps + noise() * table_.gyro_noise);
    store(table_.accelerometer + offset,
          accelerometer[i] / table_.accelerometer_mps2 + noise() * table_.accelerometer_noise);
  }
  store(table_.temperature,
        (kTemperatureCdeg - table_.temperature_offset_cdeg) / 100.0 * table_.temperature_counts);
}

SimulatedImu::Vector SimulatedImu::mounted(const Vector& robot) const {
  const bool is_otherwise =
      faults_.forward >= 0 && faults_.up >= 0 && faults_.forward % 3 != faults_.up % 3;
  const Vector forward = is_otherwise ? unit_vector(static_cast<Axis>(faults_.forward)) : forward_;
  const Vector up = is_otherwise ? unit_vector(static_cast<Axis>(faults_.up)) : up_;
  Vector chip{};
  for (size_t i = 0; i < 3; ++i) {
    const size_t j = (i + 1) % 3;
    const size_t k = (i + 2) % 3;
    const double left = up[j] * forward[k] - up[k] * forward[j];
    chip[i] = robot[0] * forward[i] + robot[1] * left + robot[2] * up[i];
  }
  return chip;
}

void SimulatedImu::store(uint8_t offset, double counts) {
  const auto value = static_cast<uint16_t>(saturated(counts));
  uint8_t* const at = &registers_[static_cast<uint8_t>(table_.data_register + offset)];
  at[table_.is_big_endian ? 0 : 1] = static_cast<uint8_t>(value >> 8);
  at[table_.is_big_endian ? 1 : 0] = static_cast<uint8_t>(value);
}

/// Three numbers of equal distribution between -1 and 1 have a variance of 1 together.
double SimulatedImu::noise() {
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) sum += symmetric(random_.next());
  return sum * faults_.noise;
}

// --- a power sensor ------------------------------------------------------------------------------

SimulatedPowerSensor::SimulatedPowerSensor(const Peripheral& entry, const SimulatedBoard& board)
    : table_(*power_table_of(entry.chip)), board_(board), shunt_ohm_(entry.value_a * 1e-4) {}

void SimulatedPowerSensor::write(const uint8_t* data, size_t size) {
  if (size == 3 && data[0] == 0) setup_ = static_cast<uint16_t>(data[1] << 8 | data[2]);
}

void SimulatedPowerSensor::read(uint8_t at, uint8_t* out, size_t size) {
  const uint16_t value = value_of(at);
  for (size_t i = 0; i < size; ++i) out[i] = static_cast<uint8_t>(i % 2 == 0 ? value >> 8 : value);
}

uint16_t SimulatedPowerSensor::value_of(uint8_t at) const {
  if (at == 0) return setup_;
  if (at == table_.bus_register) {
    const double counts = board_.plant.supply_v() * 1e6 / table_.bus_uv;
    const auto most = 32767.0 / (1 << table_.bus_shift);
    return static_cast<uint16_t>(std::lround(std::min(counts, most)) << table_.bus_shift);
  }
  if (at == 1) {
    const double shunt_v = board_.plant.drawn_a(board_.bridges()) * shunt_ohm_;
    return static_cast<uint16_t>(saturated(shunt_v * 1e9 / table_.shunt_nv));
  }
  return at == table_.identity_register ? table_.identity : 0;
}

// --- a bus ---------------------------------------------------------------------------------------

void SimulatedBus::look(const SimulatedBoard& board) {
  is_wired_ = board.is_free(data_pin_) && board.is_free(clock_pin_);
}

template <typename Act>
I2cResult SimulatedBus::transfer(uint8_t address, size_t bytes, Act act) {
  if (is_hung != nullptr && *is_hung) {
    clock_.spent_us += kTransferUs;
    return I2cResult::kHung;
  }
  const auto chip = std::find_if(chips_.begin(), chips_.end(), [&](const Chip& candidate) {
    return is_wired_ && candidate.address == address && !candidate.is_absent;
  });
  // An unacknowledged address ends the transfer.
  const size_t sent = chip == chips_.end() ? 1 : bytes;
  clock_.spent_us += static_cast<uint64_t>(kByteUs * static_cast<double>(sent));
  if (chip == chips_.end()) return I2cResult::kNoAcknowledge;
  act(chip->target);
  return I2cResult::kOk;
}

I2cResult SimulatedBus::write(uint8_t address, const uint8_t* data, size_t size) {
  return transfer(address, 1 + size, [&](I2cTarget& chip) { chip.write(data, size); });
}

/// The address is sent twice, the register once.
I2cResult SimulatedBus::read(uint8_t address, uint8_t at, uint8_t* out, size_t size) {
  return transfer(address, 3 + size, [&](I2cTarget& chip) { chip.read(at, out, size); });
}

// --- all -----------------------------------------------------------------------------------------

void I2cChips::take_up(const PeripheralList& list) {
  const bool is_same =
      list.count == list_.count && std::equal(list.begin(), list.end(), list_.begin());
  if (!is_same || !has_chips_) wire(list);
  list_ = list;
  sensors = {};
  clock_ = {};
  next_poll_us_ = 0;
  for (size_t i = 0; i < list.count; ++i) {
    const Peripheral& entry = list.entries[i];
    if (!is_on_bus(entry.kind)) continue;
    DataReady* const ready = imus_[i] && entry.pin_c >= 0 ? &*imus_[i] : nullptr;
    sensors.add(i, entry, bus_of(entry), ready);
  }
}

void I2cChips::wire(const PeripheralList& list) {
  buses_.clear();
  for (size_t i = 0; i < kMostPeripherals; ++i) {
    imus_[i].reset();
    power_sensors_[i].reset();
    if (i >= list.count) continue;
    const Peripheral& entry = list.entries[i];
    if (entry.kind == PeripheralKind::kImu) {
      imus_[i].emplace(entry, imu, mix(seed_ + i), board_.now());
      bus_of(entry).add(address_of(entry), *imus_[i], imu.absent);
      bus_of(entry).is_hung = &imu.bus_hung;
    }
    if (entry.kind == PeripheralKind::kPower) {
      power_sensors_[i].emplace(entry, board_);
      bus_of(entry).add(address_of(entry), *power_sensors_[i], power_absent);
    }
  }
  has_chips_ = true;
}

SimulatedBus& I2cChips::bus_of(const Peripheral& entry) {
  for (SimulatedBus& bus : buses_)
    if (bus.is_of(entry)) return bus;
  return buses_.emplace_back(entry, clock_);
}

void I2cChips::reset_imus() {
  for (auto& chip : imus_)
    if (chip) chip->lose_settings();
}

void I2cChips::reset_power_sensors() {
  for (auto& chip : power_sensors_)
    if (chip) chip->lose_settings();
}

void I2cChips::advance(bool is_running) {
  if (buses_.empty()) return;
  for (auto& chip : imus_)
    if (chip) chip->advance(board_);
  const uint64_t now_us = board_.device_us();
  if (!is_running || now_us < next_poll_us_) return;
  clock_ = {.woken_us = now_us};
  for (SimulatedBus& bus : buses_) bus.look(board_);
  sensors.poll();
  // The task sleeps until the next millisecond, once it is done.
  const uint64_t awake_us = now_us + clock_.spent_us;
  next_poll_us_ = (awake_us / I2cSensors::kPollUs + 1) * I2cSensors::kPollUs;
}

}  // namespace wheelwire::sim
