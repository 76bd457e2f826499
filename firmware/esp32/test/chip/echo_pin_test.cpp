// A range sensor at the chip's pins: what its capture unit sees, and what that is a pulse of.
#include "echo_pin.hpp"

#include "check.hpp"
#include "driver/gpio.h"
#include "esp_rom_sys.h"
#include "esp_timer.h"

using namespace wheelwire;

namespace {

constexpr int8_t kTrigger = 21;
constexpr int8_t kEcho = 34;
constexpr uint32_t kTicksPerUs = 80;

/// A sensor, started, and what happens at its echo.
class EchoWorld {
 public:
  explicit EchoWorld(int8_t echo = kEcho) : echo_pin_(echo) {
    fake_matrix = {};
    fake_capture = {};
    fake_time_us = 1'000'000;
    CHECK(timer.start());
    CHECK(echo_.start(timer, {.kind = PeripheralKind::kRange, .pin_a = kTrigger, .pin_b = echo}));
  }
  EchoWorld(const EchoWorld&) = delete;
  EchoWorld& operator=(const EchoWorld&) = delete;

  CaptureTimer timer;

  EchoPin& pins() { return echo_; }
  /// The counter started at another time than the clock.
  uint32_t ticks() const { return static_cast<uint32_t>(fake_time_us) * kTicksPerUs - 12'345; }
  /// An edge so much later than the last one. `late_us`: when the interrupt comes.
  void edge(bool rises, int64_t after_us, int64_t late_us = 0) {
    fake_time_us += after_us;
    const uint32_t at = ticks();
    fake_time_us += late_us;
    fake_capture.edge(echo_pin_, rises, at);
    fake_time_us -= late_us;
  }
  void pulse(int64_t after_us, int64_t length_us) {
    edge(true, after_us);
    edge(false, length_us);
  }
  bool has_pulse_of(uint32_t length_us) {
    EchoPulse pulse;
    return echo_.take(pulse) && pulse.length_us == length_us;
  }
  bool has_none() {
    EchoPulse pulse;
    return !echo_.take(pulse);
  }

 private:
  int8_t echo_pin_;
  EchoPin echo_;
};

}  // namespace

TEST(a_pulse_has_its_length_from_the_counter_and_its_time_from_the_clock) {
  EchoWorld world;
  world.edge(true, 450);
  const auto rise_us = static_cast<uint64_t>(fake_time_us);
  CHECK(world.has_none());
  world.edge(false, 5831);
  EchoPulse pulse;
  CHECK(world.pins().take(pulse));
  CHECK(pulse.rise_us == rise_us && pulse.length_us == 5831);
  CHECK(world.has_none());
}

TEST(an_interrupt_that_comes_late_changes_no_length) {
  EchoWorld world;
  world.edge(true, 450, 90);
  world.edge(false, 5831, 200);
  EchoPulse pulse;
  CHECK(world.pins().take(pulse) && pulse.length_us == 5831);
  CHECK(pulse.rise_us + pulse.length_us == static_cast<uint64_t>(fake_time_us) + 200);
}

TEST(the_newest_pulse_replaces_one_that_was_not_taken_and_the_counter_may_wrap_within_it) {
  EchoWorld world;
  fake_time_us = (int64_t{1} << 32) / kTicksPerUs - 5000;
  world.pulse(450, 3000);
  world.pulse(1000, 9000);
  CHECK(world.has_pulse_of(9000) && world.has_none());
}

TEST(a_spike_and_a_level_that_was_high_at_the_start_are_no_pulse_and_take_none_away) {
  EchoWorld world;
  world.edge(false, 5000);
  CHECK(world.has_none());
  world.pulse(450, EchoPin::kSpikeUs - 1);
  CHECK(world.has_none());
  world.pulse(450, 3000);
  world.pulse(100, EchoPin::kSpikeUs - 1);
  world.edge(true, 100);  // One more that has not ended.
  CHECK(world.has_pulse_of(3000));
}

TEST(a_pulse_goes_on_after_a_spike_downwards) {
  EchoWorld world;
  world.pulse(450, 1000);
  world.pulse(EchoPin::kSpikeUs - 1, 2000);
  CHECK(world.has_pulse_of(1000 + EchoPin::kSpikeUs - 1 + 2000));
  // Both edges came before the interrupt: the unit keeps the second one.
  world.edge(true, 60'000);
  world.edge(true, 1000);
  world.edge(false, 2000);
  CHECK(world.has_pulse_of(3000));
}

TEST(the_trigger_is_low_until_it_is_fired_and_for_so_long) {
  EchoWorld world;
  CHECK(fake_matrix.enabled[kTrigger] && !fake_matrix.enabled[kEcho]);
  CHECK(!fake_matrix.ever_high.contains(kTrigger));
  uint32_t high_us = 0;
  fake_on_delay = [&](uint32_t us) {
    if (fake_matrix.levels[kTrigger]) high_us += us;
  };
  world.pins().trigger(10);
  fake_on_delay = nullptr;
  CHECK(high_us == 10);
  CHECK(fake_matrix.ever_high.contains(kTrigger) && !fake_matrix.levels[kTrigger]);
}

TEST(an_echo_without_its_wire_is_low_where_the_chip_can_pull_it) {
  EchoWorld input_only;
  CHECK(fake_capture.group == 1 && fake_capture.timers == 1);  // The motors' PWM has the other one.
  CHECK(!fake_matrix.pulled_down[kEcho]);
  EchoWorld world(16);
  CHECK(fake_matrix.pulled_down[16]);
}

TEST(a_timer_that_does_not_start_is_reported) {
  fake_capture = {};
  fake_capture.timer_result = ESP_FAIL;
  CHECK(!CaptureTimer().start());
  fake_capture = {};
  fake_capture.resolution_hz = 0;
  CHECK(!CaptureTimer().start());
}
