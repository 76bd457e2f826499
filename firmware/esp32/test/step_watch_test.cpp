#include "step_watch.hpp"

#include "check.hpp"

using namespace wheelwire;

namespace {

constexpr uint32_t kRatesHz[] = {100, 101, 150, 200,  250,  300, 333,
                                 400, 500, 750, 1000, 2000, 5000};

/// Control steps until they stop at `freeze_us`, and one interrupt. Returns when it removed the
/// drive, 0 when it never did within 200 ms.
uint32_t removed_at_us(uint32_t rate_hz, uint32_t phase_us, uint32_t freeze_us, uint32_t late_us) {
  const uint32_t period_us = 1'000'000 / rate_hz;
  const uint32_t limit = checks_without_a_step(period_us);
  StepWatch watch;
  uint32_t steps = 0;
  uint32_t next_step_us = 0;
  for (uint32_t now_us = phase_us; now_us < 200'000; now_us += kWatchPeriodUs) {
    for (; next_step_us <= now_us && next_step_us < freeze_us; next_step_us += period_us) {
      // Every other one comes late.
      if (steps % 2 == 1 && next_step_us + late_us > now_us) break;
      ++steps;
    }
    if (watch.check(steps, limit)) return now_us;
  }
  return 0;
}

}  // namespace

TEST(drive_is_removed_within_20_ms_of_the_deadline_at_every_rate) {
  for (const uint32_t rate_hz : kRatesHz) {
    const uint32_t period_us = 1'000'000 / rate_hz;
    for (uint32_t phase_us = 0; phase_us < kWatchPeriodUs; phase_us += 37) {
      for (uint32_t freeze_us = 50'000; freeze_us < 50'000 + period_us; freeze_us += 113) {
        const uint32_t last_step_us = (freeze_us - 1) / period_us * period_us;
        const uint32_t removed_us = removed_at_us(rate_hz, phase_us, freeze_us, 0);
        // The worst deadline is just behind the last step, which still drove.
        CHECK(removed_us > last_step_us && removed_us - last_step_us <= 16'000);
        if (rate_hz >= 1000) CHECK(removed_us - last_step_us <= 6'000);
      }
    }
  }
}

TEST(steps_that_come_keep_the_drive) {
  for (const uint32_t rate_hz : kRatesHz) {
    for (uint32_t phase_us = 0; phase_us < kWatchPeriodUs; phase_us += 37) {
      CHECK(removed_at_us(rate_hz, phase_us, UINT32_MAX, 0) == 0);
      CHECK(removed_at_us(rate_hz, phase_us, UINT32_MAX, 4'000) == 0);
    }
  }
}

TEST(the_drive_stays_off_until_the_next_step) {
  StepWatch watch;
  for (int i = 0; i < 5; ++i) watch.check(1, 5);
  for (int i = 0; i < 100; ++i) CHECK(watch.check(1, 5));
  CHECK(!watch.check(2, 5));
}

TEST(a_count_that_wraps_is_a_step) {
  StepWatch watch;
  for (int i = 0; i < 100; ++i) watch.check(UINT32_MAX, 5);
  CHECK(!watch.check(0, 5));
}
