// The board's peripherals at the chip's pins, and the task that reads a bus.
#include "sensors.hpp"

#include "driver/gpio.h"
#include "esp_timer.h"
#include "freertos/task.h"
#include "pin_chip.hpp"
#include "sensor_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr int kData = 16;
constexpr int kClock = 17;
constexpr int kInterrupt = 35;
constexpr UBaseType_t kControlPriority = configMAX_PRIORITIES - 1;

/// Levels of the pins; a chip on two of them.
class SensorWorld {
 public:
  SensorWorld() {
    fake_matrix = {};
    fake_gpio_interrupts.clear();
    fake_isr_services = 0;
    fake_capture = {};
    fake_priority = 0;
    fake_core = -1;
    fake_time_us = 1'000'000;
    fake_level = [this](gpio_num_t pin) {
      ++fake_time_us;
      if (pin == kData) return data() ? 1 : 0;
      if (pin == kClock) return clock() ? 1 : 0;
      return levels[pin];
    };
    fake_on_set = [this](gpio_num_t) {
      if (fake_matrix.open_drain[kData] && fake_matrix.open_drain[kClock])
        chip.follow(clock(), data());
    };
    chip.registers[0x75] = 0x68;
  }
  SensorWorld(const SensorWorld&) = delete;
  SensorWorld& operator=(const SensorWorld&) = delete;
  ~SensorWorld() {
    fake_level = nullptr;
    fake_on_set = nullptr;
    fake_sleep = nullptr;
  }

  Sensors sensors;
  std::map<int, int> levels;
  PinChip chip;
  bool data_shorted = false;
  int sleeps = 0;

  /// Runs the task for this long. The chip measures 200 times a second; `each_ms` is called each
  /// millisecond.
  void run_task(const PeripheralList& list, int milliseconds,
                const std::function<void()>& each_ms) {
    fake_sleep = [&, milliseconds](TickType_t ticks) {
      CHECK(ticks == 1);
      if (++sleeps > milliseconds) throw EndOfTask{};
      fake_time_us = (fake_time_us / 1000 + 1) * 1000;
      if (sleeps % 5 == 0) measure();
      each_ms();
    };
    CHECK(fake_run([&] { sensors.start(list); }));
  }

 private:
  bool data() { return released(kData) && !chip.pulls_data && !data_shorted; }
  bool clock() { return released(kClock); }
  static bool released(int pin) { return !fake_matrix.open_drain[pin] || fake_matrix.levels[pin]; }

  void measure() {
    ++chip.registers[0x48];
    const auto interrupt = fake_gpio_interrupts.find(kInterrupt);
    if (interrupt != fake_gpio_interrupts.end() && chip.registers[0x38] == 1)
      interrupt->second.handler(interrupt->second.context);
  }
};

}  // namespace

TEST(inputs_have_the_pulls_of_their_entries_and_no_task) {
  SensorWorld world;
  world.levels = {{34, 1}, {13, 0}, {14, 1}};
  CHECK(world.sensors.start(list_of(
      {{.kind = PeripheralKind::kBattery},
       {.kind = PeripheralKind::kBumper, .pin_a = 34},
       {.kind = PeripheralKind::kCliff, .flags = peripheralflag::kPullUp, .pin_a = 13},
       {.kind = PeripheralKind::kStageFault, .flags = peripheralflag::kPullDown, .pin_a = 14}})));
  CHECK(!fake_matrix.pulled_up[34] && !fake_matrix.pulled_down[34]);
  CHECK(fake_matrix.pulled_up[13] && !fake_matrix.pulled_down[13]);
  CHECK(!fake_matrix.pulled_up[14] && fake_matrix.pulled_down[14]);
  CHECK(world.sensors.levels() == 0b1010);
  CHECK(fake_core == -1);  // No task was created.
}

TEST(a_level_has_changed_when_two_samples_say_so) {
  SensorWorld world;
  world.levels[34] = 0;
  CHECK(world.sensors.start(list_of({{.kind = PeripheralKind::kBumper, .pin_a = 34}})));
  std::vector<int> samples;
  fake_level = [&samples](gpio_num_t) {
    const int level = samples.front();
    samples.erase(samples.begin());
    return level;
  };
  const struct {
    std::vector<int> samples;
    uint16_t levels;
  } looks[] = {{{1, 0}, 0}, {{1, 1}, 1}, {{1}, 1}, {{0, 1}, 1}, {{0, 0}, 0}};  // First a spike.
  for (const auto& look : looks) {
    samples = look.samples;
    CHECK(world.sensors.levels() == look.levels && samples.empty());
  }
}

TEST(the_task_reads_an_imu_at_its_interrupt_s_time_and_its_bus_never_drives_high) {
  SensorWorld world;
  std::vector<ImuReading> readings;
  int64_t edge_us = 0;
  world.run_task(list_of({{.kind = PeripheralKind::kBattery}, kImu}), 500, [&] {
    ImuReading reading;
    if (!world.sensors.take(1, reading)) return;
    CHECK(reading.state == SensorState::kOk && reading.bound_us == ImuDriver::kEdgeBoundUs);
    CHECK(readings.empty() || reading.gyro[2] - readings.back().gyro[2] == 1);
    edge_us = static_cast<int64_t>(reading.t_us);
    CHECK(edge_us <= fake_time_us && edge_us > fake_time_us - 8'000);
    readings.push_back(reading);
  });
  CHECK(world.chip.registers[0x1b] == 0x08);
  CHECK(readings.size() >= 75);
  CHECK(fake_matrix.interrupts[kInterrupt] && !fake_matrix.pulled_down[kInterrupt]);
  CHECK(fake_matrix.open_drain[kData] && fake_matrix.open_drain[kClock]);
  CHECK(fake_matrix.pulled_up[kData] && fake_matrix.pulled_up[kClock]);
  CHECK(!fake_matrix.ever_high.contains(kData) && !fake_matrix.ever_high.contains(kClock));
  CHECK(fake_core == 0 && fake_priority < kControlPriority);
}

TEST(two_chips_share_a_bus_and_its_interrupts_start_once) {
  SensorWorld world;
  Peripheral second = kImu;
  second.chip = SensorChip::kLsm6ds3;
  second.place = Place::kRear;
  second.pin_c = 13;
  int absent = 0;
  int ok = 0;
  world.run_task(list_of({kImu, second}), 400, [&] {
    ImuReading reading;
    if (world.sensors.take(0, reading) && reading.state == SensorState::kOk) ++ok;
    if (world.sensors.take(1, reading) && reading.state == SensorState::kAbsent) ++absent;
  });
  CHECK(ok > 50 && absent >= 3);
  CHECK(fake_isr_services == 1);
  CHECK(fake_matrix.pulled_down[13]);  // GPIO 35 has no pull, this one has.
}

TEST(the_task_fires_range_sensors_in_turn_and_beside_a_bus_that_hangs) {
  SensorWorld world;
  PeripheralList list = list_of({kImu});
  for (const int8_t pin : std::initializer_list<int8_t>{13, 21, 26})
    list.entries[list.count++] = {.kind = PeripheralKind::kRange,
                                  .chip = SensorChip::kHcSr04,
                                  .pin_a = pin,
                                  .pin_b = static_cast<int8_t>(pin + 1)};
  world.data_shorted = true;
  int measured[4]{};
  // 400 us after each trigger, so much further away at each sensor.
  const auto on_set = fake_on_set;
  std::vector<std::pair<int, uint32_t>> falls;
  fake_on_set = [&](gpio_num_t pin) {
    on_set(pin);
    if ((pin != 13 && pin != 21 && pin != 26) || !fake_matrix.levels[pin]) return;
    const auto rise = static_cast<uint32_t>(fake_time_us + 400) * 80;
    fake_capture.edge(pin + 1, true, rise);
    falls.push_back({pin + 1, rise + static_cast<uint32_t>(pin) * 100 * 80});
  };
  world.run_task(list, 2000, [&] {
    for (const auto& [pin, ticks] : falls) {
      // The interrupt comes at the end of the pulse.
      fake_time_us += pin * 100;
      fake_capture.edge(pin, false, ticks);
    }
    falls.clear();
    for (size_t channel = 1; channel < 4; ++channel) {
      RangeReading reading;
      if (!world.sensors.take(channel, reading)) continue;
      ++measured[channel];
      CHECK(reading.state == SensorState::kOk && reading.quality == RangeQuality::kGood);
      const uint32_t pulse_us = static_cast<uint32_t>(list.entries[channel].pin_a) * 100;
      CHECK(reading.distance_mm == (pulse_us * 1715 + 5000) / 10'000);
    }
  });
  for (size_t channel = 1; channel < 4; ++channel) CHECK(measured[channel] >= 8);
  CHECK(fake_core == 0 && fake_priority < kControlPriority);
}

TEST(range_sensors_alone_have_the_task_too) {
  SensorWorld world;
  std::vector<SensorState> states;
  const Peripheral range{
      .kind = PeripheralKind::kRange, .chip = SensorChip::kHcSr04, .pin_a = 21, .pin_b = 34};
  world.run_task(list_of({range}), 500, [&] {
    RangeReading reading;
    if (world.sensors.take(0, reading)) states.push_back(reading.state);
  });
  CHECK(states.size() >= 5);
  for (const SensorState state : states) CHECK(state == SensorState::kAbsent);
}

TEST(a_pin_that_cannot_be_set_up_is_reported) {
  for (const Peripheral& entry :
       {kImu, Peripheral{.kind = PeripheralKind::kCliff, .pin_a = 34},
        Peripheral{.kind = PeripheralKind::kRange, .chip = SensorChip::kHcSr04, .pin_a = 21}}) {
    SensorWorld world;
    fake_gpio_result = ESP_FAIL;
    CHECK(!world.sensors.start(list_of({entry})));
    CHECK(fake_core == -1);
    fake_gpio_result = ESP_OK;
  }
}
