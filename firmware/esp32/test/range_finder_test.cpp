// Range sensors from trigger to hub: what they measure, whose turn it is, and each fault by name.
#include "range_finder.hpp"

#include <deque>
#include <vector>

#include "sensor_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr const RangeTable& kTable = kRangeTables[0];
constexpr uint64_t kPeriodUs = kTable.period_us;
constexpr uint64_t kPollUs = 1000;
constexpr Place kPlaces[] = {Place::kFront, Place::kLeft, Place::kRight};

/// A sensor as the pins show it: a pulse after each trigger, whose edges the hardware keeps.
class Echo final : public EchoPins {
 public:
  explicit Echo(const uint64_t& now_us) : now_us_(now_us) {}

  uint32_t delay_us = 450;
  uint32_t length_us = 5831;  ///< 1 m
  bool is_absent = false;
  bool is_stuck = false;               ///< At the high level.
  std::vector<uint64_t> triggered_us;  ///< Since the start.
  std::vector<uint32_t> pulses_us;     ///< How long the triggers were.

  /// A spike, as of the motors, that has just ended.
  void spike(uint32_t us) { pulse_ = {now_us_ - us, us}; }

  void trigger(uint32_t us) override {
    triggered_us.push_back(now_us_);
    pulses_us.push_back(us);
    if (!is_absent && !is_stuck) pulse_ = {now_us_ + us + delay_us, length_us};
  }
  bool level() override {
    return is_stuck || (pulse_.length_us != 0 && now_us_ >= pulse_.rise_us && !has_ended());
  }
  bool take(EchoPulse& out) override {
    if (pulse_.length_us == 0 || !has_ended()) return false;
    out = pulse_;
    pulse_ = {};
    return true;
  }

 private:
  bool has_ended() const { return now_us_ >= pulse_.rise_us + pulse_.length_us; }

  const uint64_t& now_us_;
  EchoPulse pulse_;
};

/// Some sensors, and the sensors' task each millisecond.
class RangeRig final : public HubRig {
 public:
  explicit RangeRig(size_t count = 1) {
    for (size_t i = 0; i < count; ++i) {
      list_.entries[i] = {.kind = PeripheralKind::kRange,
                          .chip = SensorChip::kHcSr04,
                          .place = kPlaces[i],
                          .pin_a = static_cast<int8_t>(2 * i),
                          .pin_b = static_cast<int8_t>(2 * i + 1)};
      echoes.emplace_back(now_us_);
      finder_.add(i, list_.entries[i], echoes[i]);
    }
    list_.count = static_cast<uint8_t>(count);
    hub_.start(*this, list_);
  }

  std::deque<Echo> echoes;
  bool is_polled = true;
  std::vector<std::pair<size_t, RangeReading>> readings;  ///< By channel.
  std::vector<uint16_t> samples;

  uint64_t round_us() const { return hub_.range_round_us(); }
  uint64_t now_us() const { return now_us_; }
  /// The newest one after two rounds.
  RangeReading newest() {
    readings.clear();
    run(2 * round_us() + 2 * kPollUs);
    return readings.empty() ? RangeReading{} : readings.back().second;
  }

  using HubRig::take;
  bool take(size_t channel, RangeReading& out) override { return finder_.take(channel, out); }
  using HubRig::on_reading;
  void on_reading(size_t channel, const RangeReading& reading, uint16_t sample) override {
    readings.push_back({channel, reading});
    samples.push_back(sample);
  }

 private:
  void poll() override {
    if (is_polled && now_us_ % kPollUs == 0) finder_.poll(now_us_);
  }

  RangeFinder finder_;
};

}  // namespace

// --- what it measures ----------------------------------------------------------------------------

TEST(what_cannot_be_measured_is_no_distance) {
  const struct {
    uint32_t length_us;
    RangeQuality quality;
    uint16_t distance_mm;
  } cases[] = {
      {30, RangeQuality::kNear, 0},     {113, RangeQuality::kNear, 0},
      {117, RangeQuality::kGood, 20},   {23'324, RangeQuality::kGood, 4000},
      {23'330, RangeQuality::kFar, 0},  {29'999, RangeQuality::kFar, 0},
      {38'000, RangeQuality::kFar, 0},  {55'000, RangeQuality::kFar, 0},
      {200'000, RangeQuality::kFar, 0},
  };
  for (const auto& one : cases) {
    RangeRig rig;
    rig.echoes[0].length_us = one.length_us;
    const RangeReading found = rig.newest();
    CHECK(found.state == SensorState::kOk);
    CHECK(found.quality == one.quality && found.distance_mm == one.distance_mm);
  }
}

TEST(the_length_of_a_pulse_is_a_distance_and_its_middle_the_time) {
  RangeRig rig;
  rig.run(kPeriodUs + 20'000);
  CHECK(rig.readings.size() == 1);
  const RangeReading found = rig.readings.at(0).second;
  CHECK(found.quality == RangeQuality::kGood && found.distance_mm == 1000);
  const uint64_t rise_us = rig.echoes[0].triggered_us.back() + kTable.trigger_us + 450;
  CHECK(found.t_us == rise_us + 5831 / 2);
  for (const uint32_t us : rig.echoes[0].pulses_us) CHECK(us == kTable.trigger_us);
  CHECK(found.bound_us >= 200 && found.bound_us < 1000);
}

TEST(each_measurement_is_handed_on_once) {
  RangeRig rig;
  rig.run(20 * kPeriodUs);
  CHECK(rig.readings.size() >= 17 && rig.readings.size() <= 19);
  for (size_t i = 1; i < rig.samples.size(); ++i) {
    CHECK(rig.samples[i] == rig.samples[i - 1] + 1);
    CHECK(rig.readings[i].second.t_us >= rig.readings[i - 1].second.t_us + kPeriodUs);
  }
}

/// A pin that becomes an output may start a measurement by itself.
TEST(the_first_trigger_comes_when_every_sound_of_the_start_has_faded) {
  RangeRig rig;
  rig.run(kPeriodUs);
  CHECK(rig.echoes[0].triggered_us.empty());
  rig.run(2 * kPollUs);
  CHECK(rig.echoes[0].triggered_us.size() == 1);
}

// --- in turn -------------------------------------------------------------------------------------

TEST(sensors_measure_in_turn_a_period_apart) {
  RangeRig rig(3);
  CHECK(rig.round_us() == 3 * kPeriodUs);
  for (size_t i = 0; i < 3; ++i) rig.echoes[i].length_us = static_cast<uint32_t>(1000 + 1000 * i);
  rig.run(4 * rig.round_us());
  for (size_t turn = 0; turn < 3; ++turn)
    for (size_t i = 0; i < 3; ++i) {
      const uint64_t at_us = rig.echoes[i].triggered_us[turn];
      const auto& later = rig.echoes[(i + 1) % 3].triggered_us;
      const uint64_t next_us = later[i == 2 ? turn + 1 : turn];
      CHECK(next_us >= at_us + kPeriodUs && next_us <= at_us + kPeriodUs + kPollUs);
    }
  for (const auto& [channel, reading] : rig.readings)
    CHECK(reading.distance_mm == (1000 + 1000 * channel) * 1715 / 10'000 + (channel != 1));
}

// --- faults --------------------------------------------------------------------------------------

TEST(a_sensor_that_does_not_answer_is_absent_and_one_that_stays_high_is_hung_and_not_triggered) {
  const struct {
    bool Echo::* fault;
    SensorState state;
    uint64_t limit_us;
  } faults[] = {
      {&Echo::is_absent, SensorState::kAbsent, 2 * kPeriodUs + 5'000},
      {&Echo::is_stuck, SensorState::kHung, RangeFinder::kHungUs + 2 * kPeriodUs},
  };
  for (const auto& [fault, state, limit_us] : faults) {
    for (uint64_t phase_us = 0; phase_us < kPeriodUs; phase_us += 2900) {
      RangeRig rig;
      Echo& echo = rig.echoes[0];
      rig.run(5 * kPeriodUs + phase_us);
      CHECK(rig.state() == SensorState::kOk);
      echo.*fault = true;
      const size_t triggers = echo.triggered_us.size();
      CHECK(rig.until(state) <= limit_us);
      CHECK(state == SensorState::kAbsent || echo.triggered_us.size() == triggers);
      rig.readings.clear();
      rig.run(1'000'000);
      CHECK(rig.readings.empty() && rig.state() == state);
      echo.*fault = false;
      CHECK(rig.until(SensorState::kOk) <= 2 * kPeriodUs);
    }
  }
}

/// Some parts keep the output high for long where nothing reflects the sound: they are busy.
TEST(an_output_that_falls_late_is_not_hung) {
  RangeRig rig;
  rig.echoes[0].length_us = 200'000;
  for (int i = 0; i < 100; ++i) {
    rig.run(20'000);
    CHECK(rig.state() != SensorState::kHung && rig.state() != SensorState::kAbsent);
  }
  CHECK(rig.readings.size() >= 6);
  for (const auto& [channel, reading] : rig.readings)
    CHECK(reading.quality == RangeQuality::kFar && reading.t_us <= rig.now_us());
}

/// It would be the nearest thing in the way.
TEST(a_pulse_that_began_before_the_trigger_is_no_echo) {
  RangeRig rig;
  rig.echoes[0].is_absent = true;
  rig.run(5 * kPeriodUs);
  for (const uint32_t early_us : {200u, 5000u}) {
    for (int i = 0; i < 10; ++i) {
      const size_t triggers = rig.echoes[0].triggered_us.size();
      while (rig.echoes[0].triggered_us.size() == triggers) rig.run(100);
      rig.echoes[0].spike(early_us);
      rig.run(20'000);
      // It came and went unnoticed.
      rig.echoes[0].spike(early_us);
    }
  }
  CHECK(rig.readings.empty() && rig.state() == SensorState::kAbsent);
}

TEST(a_task_that_no_longer_runs_is_missed_after_two_rounds) {
  for (const size_t count : {1u, 3u}) {
    RangeRig rig(count);
    rig.run(3 * rig.round_us());
    rig.is_polled = false;
    const uint64_t took_us = rig.until(SensorState::kMissed);
    CHECK(took_us >= rig.round_us() && took_us <= 2 * rig.round_us() + 2'000);
    rig.is_polled = true;
    CHECK(rig.until(SensorState::kOk) <= 2 * rig.round_us());
  }
}

/// Buses that hang keep the task for a while at each poll.
TEST(a_task_that_comes_late_measures_as_well) {
  RangeRig rig;
  rig.is_polled = false;
  for (int i = 0; i < 200; ++i) {
    rig.run(7'000);
    rig.is_polled = true;
    rig.run(1'000);
    rig.is_polled = false;
  }
  CHECK(rig.state() == SensorState::kOk && rig.readings.size() >= 20);
  for (const auto& [channel, reading] : rig.readings) CHECK(reading.distance_mm == 1000);
}
