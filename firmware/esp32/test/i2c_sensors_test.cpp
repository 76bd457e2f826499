// IMUs and power sensors by their tables, on a bus that fails as a test says.
#include "i2c_sensors.hpp"

#include <map>
#include <vector>

#include "sensor_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr uint64_t kSampleUs = ImuDriver::kPeriodUs;

/// A chip of registers of one byte, or of 16 bits.
struct FakeChip {
  std::map<uint8_t, uint8_t> bytes;
  std::map<uint8_t, uint16_t> words;
  bool is_absent = false;
  int failures = 0;  ///< So many transfers are not acknowledged.
  int writes = 0;

  uint8_t at(uint8_t index, size_t offset) {
    if (words.empty()) return bytes[static_cast<uint8_t>(index + offset)];
    return static_cast<uint8_t>(offset == 0 ? words[index] >> 8 : words[index]);
  }
};

class Bus final : public I2cBus {
 public:
  std::map<uint8_t, FakeChip> chips;
  bool is_hung = false;
  uint64_t time_us = 0;
  uint64_t byte_us = 25;
  int recoveries = 0;
  std::function<void(uint8_t at)> on_read;  ///< At its end.

  I2cResult write(uint8_t address, const uint8_t* data, size_t size) override {
    const I2cResult result = transfer(address, 1 + size);
    if (result != I2cResult::kOk) return result;
    FakeChip& chip = chips[address];
    ++chip.writes;
    if (chip.words.empty()) {
      chip.bytes[data[0]] = data[1];
    } else {
      chip.words[data[0]] = static_cast<uint16_t>(data[1] << 8 | data[2]);
    }
    return result;
  }
  I2cResult read(uint8_t address, uint8_t at, uint8_t* out, size_t size) override {
    const I2cResult result = transfer(address, 3 + size);
    if (result == I2cResult::kOk)
      for (size_t i = 0; i < size; ++i) out[i] = chips[address].at(at, i);
    if (on_read) on_read(at);
    return result;
  }
  void recover() override { ++recoveries; }
  uint64_t now_us() override { return time_us; }

 private:
  I2cResult transfer(uint8_t address, size_t bytes) {
    if (is_hung) {
      time_us += kTransferUs;
      return I2cResult::kHung;
    }
    time_us += byte_us * bytes;
    if (chips.count(address) == 0 || chips[address].is_absent) return I2cResult::kNoAcknowledge;
    if (chips[address].failures == 0) return I2cResult::kOk;
    --chips[address].failures;
    return I2cResult::kNoAcknowledge;
  }
};

struct Edges final : DataReady {
  uint64_t newest_us = 0;
  uint64_t edge_us() override { return newest_us; }
};

void put_bytes(FakeChip& chip, uint8_t at, const std::vector<uint8_t>& bytes) {
  for (size_t i = 0; i < bytes.size(); ++i) chip.bytes[static_cast<uint8_t>(at + i)] = bytes[i];
}

/// A robot's IMU: the sensors' task polls each millisecond unless it is busy.
class I2cRig : public HubRig {
 public:
  static constexpr uint8_t kAddress = 0x68;

  explicit I2cRig(bool has_interrupt) {
    list_.count = 1;
    list_.entries[0] = {.kind = PeripheralKind::kImu, .chip = SensorChip::kMpu6050};
    chip().bytes[0x75] = 0x68;
    sensors.add(0, list_.entries[0], bus, has_interrupt ? &edges : nullptr);
    hub_.start(*this, list_);
  }

  Bus bus;
  Edges edges;
  I2cSensors sensors;
  bool reads_sensors = true;
  bool is_frozen = false;            ///< It repeats its newest sample.
  std::vector<uint64_t> sampled_us;  ///< When the chip measured the samples 1, 2, ...
  std::vector<ImuReading> readings;
  std::vector<SensorState> states;

  FakeChip& chip() { return bus.chips[kAddress]; }
  uint16_t identity() const { return hub_.identity(0); }
  uint64_t now_us() const { return now_us_; }

  using HubRig::take;
  bool take(size_t channel, ImuReading& out) override { return sensors.take(channel, out); }
  void on_sensor_event(SensorEventCode code, size_t, uint16_t value, uint64_t) override {
    if (code == SensorEventCode::kState) states.push_back(static_cast<SensorState>(value));
  }
  using HubRig::on_reading;
  void on_reading(size_t, const ImuReading& reading, uint16_t) override {
    readings.push_back(reading);
  }

 private:
  void poll() override {
    if (now_us_ % kSampleUs == 700) sample();
    if (!reads_sensors || now_us_ % 1000 != 0 || bus.time_us > now_us_) return;
    bus.time_us = now_us_;
    sensors.poll();
  }
  void sample() {
    if (chip().bytes[0x6b] != 0x01) return;  // It sleeps.
    if (!is_frozen) {
      const auto count = static_cast<uint16_t>(sampled_us.size() + 1);
      sampled_us.push_back(now_us_);
      put_bytes(chip(), 0x47, {static_cast<uint8_t>(count >> 8), static_cast<uint8_t>(count)});
    }
    if (chip().bytes[0x38] == 1) edges.newest_us = now_us_;
  }
};

/// One that has run for half a second.
struct RunningRig : I2cRig {
  explicit RunningRig(bool has_interrupt) : I2cRig(has_interrupt) { run(500'000); }
};

void lose_settings(FakeChip& chip) {
  put_bytes(chip, 0x19, {0, 0, 0, 0});
  chip.bytes[0x38] = 0;
  chip.bytes[0x6b] = 0x40;
}

/// Every sample once, in order, none left out.
bool are_consecutive(const std::vector<ImuReading>& readings, size_t from = 1) {
  for (size_t i = from; i < readings.size(); ++i)
    if (readings[i].gyro[2] != readings[i - 1].gyro[2] + 1) return false;
  return true;
}

constexpr bool kInterrupt = true;

/// The first reading of a chip that measures these bytes.
ImuReading decoded(SensorChip kind, uint8_t address, uint8_t identity_register, uint8_t identity,
                   uint8_t data_register, const std::vector<uint8_t>& bytes) {
  Bus bus;
  FakeChip& chip = bus.chips[address];
  chip.bytes[identity_register] = identity;
  put_bytes(chip, data_register, bytes);
  ImuDriver driver{*imu_table_of(kind), I2cChip{bus, address}, nullptr};
  driver.poll();
  bus.time_us = 500'000;
  driver.poll();
  ImuReading reading;
  CHECK(driver.take(reading) && reading.state == SensorState::kOk);
  return reading;
}

/// Its second reading.
PowerReading measured(Bus& bus, PowerDriver& driver) {
  driver.poll();
  bus.time_us += 200'000;
  driver.poll();
  PowerReading reading;
  CHECK(driver.take(reading));
  return reading;
}

/// A power sensor that measures, and its driver, 300 ms after the start.
struct PowerRig {
  PowerRig() {
    bus.chips[0x40].words = {{0, 0x399f}, {1, 100}, {2, 0x3a98}};
    run(300'000);
  }
  void run(uint64_t duration_us) {
    for (const uint64_t end_us = now_us + duration_us; now_us < end_us; now_us += 1000) {
      if (bus.time_us > now_us) continue;  // The task is busy.
      bus.time_us = now_us;
      driver.poll();
      PowerReading reading;
      if (driver.take(reading)) readings.push_back(reading);
    }
  }
  Bus bus;
  uint64_t now_us = 0;
  PowerDriver driver{*power_table_of(SensorChip::kIna219), I2cChip{bus, 0x40}, 1000};
  std::vector<PowerReading> readings;
};

}  // namespace

// --- decoding ------------------------------------------------------------------------------------

TEST(an_mpu_sends_the_high_byte_first) {
  // x 0x0102 = 258, y -2, z 8192; 0 counts; x 655, y -655, z 0x7fff.
  const ImuReading reading =
      decoded(SensorChip::kMpu6050, 0x68, 0x75, 0x68, 0x3b,
              {0x01, 0x02, 0xff, 0xfe, 0x20, 0x00, 0x00, 0x00, 0x02, 0x8f, 0xfd, 0x71, 0x7f, 0xff});
  CHECK(reading.accelerometer[0] == 258 && reading.accelerometer[1] == -2);
  CHECK(reading.accelerometer[2] == 8192);
  CHECK(reading.gyro[0] == 655 && reading.gyro[1] == -655 && reading.gyro[2] == 32767);
  CHECK(reading.temperature_cdeg == 3653);
  // 36.53 - 3400 / 340 = 26.53 degrees.
  CHECK(decoded(SensorChip::kMpu6050, 0x68, 0x75, 0x68, 0x3b,
                {0, 0, 0, 0, 0, 0, 0xf2, 0xb8, 0, 0, 0, 0, 0, 1})
            .temperature_cdeg == 2653);
}

TEST(an_lsm6ds3_sends_the_low_byte_first) {
  // 256 counts of temperature; x 1, y -1, z 0x0102; x 0x7fff, y -32768, z 8192.
  const std::vector<uint8_t> bytes{0x00, 0x01, 0x01, 0x00, 0xff, 0xff, 0x02,
                                   0x01, 0xff, 0x7f, 0x00, 0x80, 0x00, 0x20};
  const ImuReading reading = decoded(SensorChip::kLsm6ds3, 0x6a, 0x0f, 0x69, 0x20, bytes);
  CHECK(reading.gyro[0] == 1 && reading.gyro[1] == -1 && reading.gyro[2] == 258);
  CHECK(reading.accelerometer[0] == 32767 && reading.accelerometer[1] == -32768);
  CHECK(reading.accelerometer[2] == 8192);
  CHECK(reading.temperature_cdeg == 4100);  // 16 counts for a degree above 25.
  CHECK(decoded(SensorChip::kLsm6ds3trC, 0x6a, 0x0f, 0x6a, 0x20, bytes).temperature_cdeg == 2600);
}

TEST(an_mpu9250_of_either_identity_is_known) {
  const std::vector<uint8_t> bytes{0, 0, 0, 0, 0, 0, 0x01, 0x4e, 0, 0, 0, 0, 0, 1};
  // 21 + 334 / 333.87 degrees.
  CHECK(decoded(SensorChip::kMpu9250, 0x68, 0x75, 0x71, 0x3b, bytes).temperature_cdeg == 2200);
  CHECK(decoded(SensorChip::kMpu9250, 0x69, 0x75, 0x73, 0x3b, bytes).temperature_cdeg == 2200);
}

TEST(a_chip_that_repeats_a_sample_is_frozen_within_one_more_than_its_table_says) {
  const uint64_t samples = imu_table_of(SensorChip::kMpu6050)->frozen_samples;
  for (const bool has_interrupt : {false, true}) {
    RunningRig rig{has_interrupt};
    rig.is_frozen = true;
    CHECK(rig.until(SensorState::kFrozen) <= (samples + 1) * kSampleUs);
    rig.is_frozen = false;
    CHECK(rig.until(SensorState::kOk) <= kI2cRetryUs + kI2cSettleUs + 8 * kSampleUs);
  }
}

TEST(an_ina219_measures_by_its_shunt) {
  Bus bus;
  FakeChip& chip = bus.chips[0x40];
  // 0x3a98 >> 3 = 1875 steps of 4 mV; 0x1388 = 5000 steps of 10 uV at 100 mOhm.
  chip.words = {{0, 0x399f}, {1, 0x1388}, {2, 0x3a98}};
  PowerDriver driver{*power_table_of(SensorChip::kIna219), I2cChip{bus, 0x40}, 1000};
  const PowerReading reading = measured(bus, driver);
  CHECK(chip.words[0] == 0x3ddf);
  CHECK(reading.state == SensorState::kOk);
  CHECK(reading.voltage_mv == 7500 && reading.current_ma == 500);
  CHECK(reading.t_us > 200'000 && reading.t_us < 201'000);
  chip.words[1] = 0xec78;  // -5000: the battery is charged.
  bus.time_us += 100'000;
  driver.poll();
  PowerReading charged;
  CHECK(driver.take(charged) && charged.current_ma == -500);
}

TEST(an_ina226_measures_by_its_shunt) {
  Bus bus;
  // 9600 steps of 1.25 mV; 4000 steps of 2.5 uV at 10 mOhm.
  bus.chips[0x41].words = {{0, 0x4127}, {1, 4000}, {2, 9600}, {0xfe, 0x5449}};
  PowerDriver driver{*power_table_of(SensorChip::kIna226), I2cChip{bus, 0x41}, 100};
  const PowerReading reading = measured(bus, driver);
  CHECK(reading.voltage_mv == 12'000 && reading.current_ma == 1000);
}

// --- samples -------------------------------------------------------------------------------------

TEST(each_sample_comes_once_stamped_within_its_bound) {
  for (const bool has_interrupt : {false, true}) {
    I2cRig rig{has_interrupt};
    rig.run(2'000'000);
    CHECK(rig.readings.size() >= 375 && rig.readings.size() <= 381);
    CHECK(are_consecutive(rig.readings));
    for (const ImuReading& reading : rig.readings) {
      const uint64_t measured_us = rig.sampled_us[static_cast<size_t>(reading.gyro[2]) - 1];
      const uint64_t error_us =
          reading.t_us > measured_us ? reading.t_us - measured_us : measured_us - reading.t_us;
      CHECK(error_us <= reading.bound_us);
      CHECK(reading.bound_us <= (has_interrupt ? 50 : kSampleUs + 500));
    }
    CHECK(has_interrupt || rig.readings.back().bound_us < 1'500);
    CHECK(rig.states.size() == 1 && rig.states[0] == SensorState::kOk);
  }
}

TEST(a_sample_that_is_overtaken_by_the_next_edge_is_not_used) {
  Bus bus;
  Edges edges;
  put_bytes(bus.chips[0x68], 0x75, {0x68});
  ImuDriver driver{*imu_table_of(SensorChip::kMpu6050), I2cChip{bus, 0x68}, &edges};
  driver.poll();
  bus.time_us = 200'000;
  edges.newest_us = 199'900;
  bus.on_read = [&edges](uint8_t) { edges.newest_us = 200'100; };
  driver.poll();
  ImuReading reading;
  CHECK(!driver.take(reading));
  bus.on_read = nullptr;
  driver.poll();
  CHECK(driver.take(reading) && reading.t_us == 200'100);
  // A task that comes a period late cannot know whose edge it was.
  edges.newest_us = 205'000;
  bus.chips[0x68].bytes[0x48] = 7;
  bus.time_us = 209'700;
  driver.poll();
  CHECK(!driver.take(reading));
}

TEST(an_output_that_stays_high_until_the_sample_is_read_starts_again) {
  Bus bus;
  Edges edges;
  bus.chips[0x6a].bytes[0x0f] = 0x69;
  ImuDriver driver{*imu_table_of(SensorChip::kLsm6ds3), I2cChip{bus, 0x6a}, &edges};
  bool is_high = false;
  int taken = 0;
  for (uint64_t now_us = 0; now_us < 1'000'000; now_us += 1000) {
    bus.time_us = now_us;
    // Its first sample comes before anybody listens, and its edge is lost.
    if (now_us % kSampleUs == 0 && bus.chips[0x6a].bytes[0x11] == 0x54) {
      ++bus.chips[0x6a].bytes[0x26];
      if (!is_high && now_us > 20'000) edges.newest_us = now_us;
      is_high = true;
    }
    bus.on_read = [&is_high](uint8_t at) { is_high = is_high && at != 0x20; };
    driver.poll();
    ImuReading reading;
    if (driver.take(reading) && reading.state == SensorState::kOk) ++taken;
  }
  CHECK(taken > 170);
}

// --- faults --------------------------------------------------------------------------------------

TEST(a_chip_that_never_answers_and_another_one_at_its_address_are_absent_at_once) {
  for (const bool is_another : {false, true}) {
    I2cRig rig{!kInterrupt};
    rig.chip().is_absent = !is_another;
    if (is_another) rig.chip().bytes[0x75] = 0x19;
    CHECK(rig.until(SensorState::kAbsent) <= 2'000);
    CHECK(rig.identity() == (is_another ? 0x19 : 0));
    rig.run(500'000);
    CHECK(rig.chip().writes == 0 && rig.readings.empty());  // It gets no settings.
  }
}

/// A module sold as an MPU-6050 carries one of these; the thermometers tell which table is used.
TEST(a_chip_that_is_sold_for_another_works_by_its_own_table) {
  const struct {
    uint8_t identity;
    int writes;
    int16_t temperature_cdeg;
  } chips[] = {{0x68, 6, 3653}, {0x72, 6, 3653}, {0x70, 7, 2100}, {0x98, 7, 2100}};
  for (const auto& chip : chips) {
    I2cRig rig{!kInterrupt};
    rig.chip().bytes[0x75] = chip.identity;
    rig.run(500'000);
    CHECK(rig.chip().writes == chip.writes);
    CHECK(!rig.readings.empty());
    if (!rig.readings.empty()) CHECK(rig.readings.back().temperature_cdeg == chip.temperature_cdeg);
  }
}

/// It gets the settings of its own table, although nothing shows that the earlier ones were lost.
TEST(a_chip_that_takes_the_place_of_another_is_set_up_anew) {
  I2cRig rig{!kInterrupt};
  rig.chip().bytes[0x75] = 0x70;
  rig.run(500'000);
  rig.chip().is_absent = true;
  CHECK(rig.until(SensorState::kAbsent) <= kSampleUs + 2'000);
  rig.chip().is_absent = false;
  rig.chip().bytes[0x75] = 0x68;
  const int before = rig.chip().writes;
  CHECK(rig.until(SensorState::kOk) <= 2 * kI2cRetryUs + kI2cSettleUs);
  CHECK(rig.chip().writes == before + 6);
  CHECK(rig.readings.back().temperature_cdeg == 3653);
}

TEST(a_single_transfer_that_fails_is_repeated_and_no_sample_is_lost) {
  RunningRig rig{!kInterrupt};
  for (int i = 0; i < 50; ++i) {
    rig.chip().failures = 1;
    rig.run(10'300);
  }
  CHECK(are_consecutive(rig.readings));
  CHECK(rig.states.size() == 1);
}

TEST(a_chip_that_lost_its_settings_is_reset_gets_them_again_and_time_to_settle) {
  for (const bool has_interrupt : {false, true}) {
    RunningRig rig{has_interrupt};
    const size_t before = rig.readings.size();
    lose_settings(rig.chip());
    // One that gives edges no more is asked after two periods.
    CHECK(rig.until(SensorState::kReset) <= 3 * kSampleUs + 2'000);
    const uint64_t reset_us = rig.now_us();
    CHECK(rig.readings.size() == before);
    CHECK(rig.until(SensorState::kOk) <= kI2cSettleUs + 2 * kSampleUs);
    CHECK(rig.readings[before].t_us >= reset_us + kI2cSettleUs - kSampleUs);
    CHECK(rig.chip().bytes[0x1b] == 0x08 && rig.chip().bytes[0x19] == 4);
  }
}

TEST(one_that_has_lost_its_range_only_is_not_believed) {
  RunningRig rig{!kInterrupt};
  const size_t before = rig.readings.size();
  rig.chip().bytes[0x1b] = 0;
  rig.run(2 * kSampleUs);
  CHECK(rig.state() == SensorState::kReset && rig.readings.size() == before);
}

TEST(a_task_that_reads_no_more_is_missed_within_two_periods) {
  RunningRig rig{!kInterrupt};
  rig.reads_sensors = false;
  CHECK(rig.until(SensorState::kMissed) <= 2 * kSampleUs + 2'000);
}

TEST(a_slow_clock_of_the_chip_is_not_frozen_and_loses_nothing) {
  // A sample each 5.4 ms, and a poll each millisecond: three looks may see the same sample.
  Bus bus;
  bus.chips[0x68].bytes[0x75] = 0x68;
  ImuDriver driver{*imu_table_of(SensorChip::kMpu6050), I2cChip{bus, 0x68}, nullptr};
  int16_t newest = 0;
  int taken = 0;
  uint8_t count = 0;
  for (uint64_t now_us = 0; now_us < 1'000'000; now_us += 100) {
    if (now_us % 5400 == 0) bus.chips[0x68].bytes[0x48] = ++count;
    if (now_us % 1000 != 0) continue;
    bus.time_us = now_us;
    driver.poll();
    ImuReading reading;
    if (!driver.take(reading)) continue;
    CHECK(reading.state == SensorState::kOk);
    CHECK(taken == 0 || static_cast<uint8_t>(reading.gyro[2] - newest) == 1);
    newest = reading.gyro[2];
    ++taken;
  }
  CHECK(taken >= 165);
}

TEST(a_power_sensor_s_faults_have_names) {
  PowerRig rig;
  FakeChip& chip = rig.bus.chips[0x40];
  chip.words[0] = 0x399f;
  rig.run(101'000);
  CHECK(rig.readings.back().state == SensorState::kReset);
  rig.run(250'000);
  CHECK(rig.readings.back().state == SensorState::kOk && chip.words[0] == 0x3ddf);
  chip.is_absent = true;
  rig.run(101'000);
  CHECK(rig.readings.back().state == SensorState::kAbsent);
  chip.is_absent = false;
  rig.run(250'000);
  CHECK(rig.readings.back().state == SensorState::kOk);
  rig.bus.is_hung = true;
  rig.run(120'000);
  CHECK(rig.readings.back().state == SensorState::kHung && rig.bus.recoveries > 0);
}

TEST(a_round_ends_soon_when_all_chips_hang_and_the_next_one_goes_on_after_it) {
  constexpr uint64_t kMostUs = 4 * I2cBus::kTransferUs;
  Bus bus;
  bus.is_hung = true;
  I2cSensors sensors;
  for (size_t i = 0; i < kMostPeripherals; ++i)
    sensors.add(i,
                {.kind = PeripheralKind::kImu,
                 .chip = SensorChip::kLsm6ds3,
                 .address = static_cast<uint8_t>(0x10 + i)},
                bus, nullptr);
  int hung[kMostPeripherals]{};
  for (int round = 0; round < 50; ++round) {
    const uint64_t began_us = bus.time_us;
    sensors.poll();
    CHECK(bus.time_us - began_us <= kMostUs);
    bus.time_us += I2cSensors::kPollUs;
    ImuReading reading;
    for (size_t i = 0; i < kMostPeripherals; ++i)
      if (sensors.take(i, reading) && reading.state == SensorState::kHung) ++hung[i];
  }
  for (const int count : hung) CHECK(count >= 4);
}
