// Pulses at an input, from the times that the capture unit gives.
#include "pulse_watch.hpp"

#include "check.hpp"
#include "esp_timer.h"
#include "soc/gpio_reg.h"

using namespace wheelwire;

namespace {

constexpr int kPin = 18;
constexpr int kLevelPin = 19;
constexpr uint32_t kPeriod = 4000;

class PulseWorld {
 public:
  PulseWorld() {
    fake_matrix = {};
    fake_capture = {};
    fake_time_us = 1'000'000;
    set_level(true);
    CHECK(watch.start(kPin, kLevelPin, true));
  }
  PulseWorld(const PulseWorld&) = delete;
  PulseWorld& operator=(const PulseWorld&) = delete;

  void set_level(bool level) {
    fake_matrix.registers[GPIO_IN_REG] = static_cast<uint32_t>(level) << kLevelPin;
  }
  /// A period of the PWM. Of a short pulse the fall's interrupt may come first.
  void period(uint32_t high, bool fall_first = false) {
    if (fall_first) {
      fake_capture.edge(kPin, false, at_ + high);
      fake_capture.edge(kPin, true, at_);
    } else {
      fake_capture.edge(kPin, true, at_);
      fake_capture.edge(kPin, false, at_ + high);
    }
    at_ += kPeriod;
    fake_time_us += 50;
  }

  PulseWatch watch;

 private:
  uint32_t at_ = 0xffff'f000;  // It wraps in the second period.
};

}  // namespace

TEST(a_pulse_has_its_length_whichever_edge_is_reported_first) {
  for (const unsigned fall_first : {0u, ~0u, 0b0100'1001'0010'0100'1001u}) {
    PulseWorld world;
    for (int i = 0; i < 20; ++i) world.period(10, fall_first >> i & 1);
    const Pulses seen = world.watch.take();
    CHECK(seen.rises == 20 && seen.falls == 20);
    CHECK(seen.least_period == kPeriod && seen.most_period == kPeriod);
    CHECK(seen.least_high == 10 && seen.most_high == 10);
    CHECK(world.watch.resolution_hz() == 80'000'000);
    // The encoder keeps its pull-up.
    CHECK(fake_matrix.pulled_up[kPin] && fake_capture.channels.size() == 2);
  }
}

TEST(each_look_tells_of_the_time_since_the_one_before) {
  PulseWorld world;
  world.period(3000);
  world.watch.take();
  world.period(10);
  world.period(20);
  const Pulses seen = world.watch.take();
  CHECK(seen.rises == 2 && seen.least_high == 10 && seen.most_high == 20);
  CHECK(world.watch.take().rises == 0);
}

TEST(pulses_of_the_other_direction_are_told_apart) {
  PulseWorld world;
  world.period(3000);
  world.set_level(false);
  world.period(20);
  const Pulses seen = world.watch.take();
  CHECK(seen.most_high == 3000 && seen.most_high_other == 20);
}

TEST(the_last_fall_has_the_time_of_the_device) {
  PulseWorld world;
  CHECK(PulseWatch::last_fall_us() == 0);
  world.period(10);
  const auto fall_us = static_cast<uint64_t>(fake_time_us) - 50;
  fake_time_us += 1000;
  CHECK(PulseWatch::last_fall_us() == fall_us);
}
