#include "evidence.hpp"

#include "check.hpp"
#include "overspeed.hpp"

using namespace wheelwire;

TEST(evidence_leaks_at_a_tenth_of_the_pace_at_which_it_came) {
  Evidence evidence;
  CHECK(evidence.add(300'000) == 300'000);
  for (int ms = 0; ms < 1000; ++ms) evidence.leak(1000);
  CHECK(evidence.us() == 200'000);
  for (int ms = 0; ms < 3000; ++ms) evidence.leak(1000);
  CHECK(evidence.is_none());
}

TEST(what_is_seen_three_tenths_of_the_time_adds_up_however_short_it_is) {
  Evidence evidence;
  uint32_t most_us = 0;
  for (int ms = 0; ms < 10'000 && most_us < 500'000; ++ms)
    ms % 10 < 3 ? static_cast<void>(most_us = evidence.add(1000)) : evidence.leak(1000);
  CHECK(most_us >= 500'000);
}

TEST(the_opposite_ends_it_once_it_has_lasted) {
  Evidence evidence;
  evidence.add(300'000);
  for (int ms = 0; ms < 99; ++ms) evidence.refute(1000, 100'000);
  CHECK(evidence.us() == 300'000 - 99 * 100);
  evidence.refute(1000, 100'000);
  CHECK(evidence.is_none());
  // Seen again, it has to last again.
  evidence.add(1000);
  for (int ms = 0; ms < 99; ++ms) evidence.refute(100, 10'000);
  evidence.add(1000);
  evidence.refute(100, 10'000);
  CHECK(!evidence.is_none());
}

namespace {

constexpr uint32_t kLimit_umps = 500'000;

/// Steps of a millisecond until it trips at this speed of both wheels; 0: not within 5 s.
int steps_to_trip(OverspeedMonitor& monitor, uint32_t umps, int most = 5000) {
  for (int ms = 1; ms <= most; ++ms)
    if (monitor.update(2 * umps, kLimit_umps, 1000)) return ms;
  return 0;
}

}  // namespace

TEST(half_as_fast_again_for_a_second_is_too_fast) {
  OverspeedMonitor monitor;
  CHECK(steps_to_trip(monitor, 750'000) == 0);
  CHECK(steps_to_trip(monitor, 751'000) == 1000);
  monitor.end_evidence();
  CHECK(monitor.is_quiet(2 * 750'000, kLimit_umps) && !monitor.is_quiet(1'500'001, kLimit_umps));
}

TEST(a_stop_does_not_end_it_and_to_obey_for_half_a_second_does) {
  OverspeedMonitor monitor;
  CHECK(steps_to_trip(monitor, 900'000, 900) == 0);
  for (int ms = 0; ms < 1000; ++ms) monitor.rest(1000);
  CHECK(steps_to_trip(monitor, 900'000) == 200);
  for (int ms = 0; ms < 499; ++ms) monitor.update(2 * kLimit_umps, kLimit_umps, 1000);
  CHECK(!monitor.is_quiet(0, kLimit_umps));
  monitor.update(2 * kLimit_umps, kLimit_umps, 1000);
  CHECK(monitor.is_quiet(0, kLimit_umps));
}
