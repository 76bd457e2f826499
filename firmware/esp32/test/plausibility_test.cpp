#include "plausibility.hpp"

#include "robot_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

/// The defaults, at 1 kHz.
constexpr ControllerGains kDefaultGains{
    .proportional_q24 = 659'687,
    .integral_q32 = 2'251'731,
    .feedforward_q24 = 750'394,      // 1.365 duty per m/s
    .acceleration_q24 = 78'612'693,  // 0.143 duty per m/s^2
    .delay_steps = 13,
    .static_q15 = 1802,
    .margin_q15 = 12'451,  // 0.38
    .limit_q15 = 32'767,
    .slew_umps = 1500,
    .memory_shift = 8,
};
constexpr Supply kSupply{.nominal_mv = 6100, .drop_mv = 1300, .unmeasured_mv = 6200};
constexpr uint32_t kTime_us = 300'000;

/// The most duty that is plausible at 0.1 m/s.
const int32_t kNeeded = duty_for(100'000, kDefaultGains.margin_q15, kNominal, kDefaultGains);

/// Whether a step at this duty and speed trips.
bool trips(PlausibilityMonitor& monitor, int32_t duty_q15, int32_t umps, bool ticks = true) {
  return monitor.update(duty_q15, umps, ticks, kNominal, kPeriod_us, kTime_us, kDefaultGains);
}

/// Steps until it trips at this duty and speed, ticking; 0: never.
int steps_to_implausible(PlausibilityMonitor& monitor, int32_t duty_q15, int32_t umps,
                         int tick_every = 1) {
  for (int step = 1; step <= 5000; ++step)
    if (trips(monitor, duty_q15, umps, step % tick_every == 0)) return step;
  return 0;
}
int steps_to_implausible(int32_t duty_q15, int32_t umps, int tick_every = 1) {
  PlausibilityMonitor monitor;
  return steps_to_implausible(monitor, duty_q15, umps, tick_every);
}

/// Steps until it trips while a wheel whose encoder reports this share of its speed is driven at
/// full duty from rest, by a robot so many times heavier than its feed-forward says; 0: never.
int steps_to_trip_from_rest(double seen, double heaviness, int direction = 1,
                            double start_mps = 0) {
  PlausibilityMonitor monitor;
  double speed_mps = start_mps;
  for (int step = 1; step <= 4000; ++step) {
    const double needed = 1.365 * speed_mps + 0.055;
    speed_mps += (1.0 - needed) / (0.143 * heaviness) * 1e-3;
    const auto measured = static_cast<int32_t>(speed_mps * seen * 1e6) * direction;
    if (trips(monitor, 32'767 * direction, measured)) return step;
  }
  return 0;
}

}  // namespace

TEST(a_lower_battery_allows_more_duty) {
  CHECK(supply_ratio_q12(7400, kSupply) == kNominal);
  CHECK(magnitude(supply_ratio_q12(5500, kSupply) - 5949) <= 1);
  CHECK(magnitude(supply_ratio_q12(9000, kSupply) - 3244) <= 1);
  CHECK(supply_ratio_q12(0, kSupply) == supply_ratio_q12(6200, kSupply));
  CHECK(supply_ratio_q12(1300, kSupply) == 4 * kNominal);
  CHECK(supply_ratio_q12(1, kSupply) == 4 * kNominal);
}

TEST(duty_beyond_feed_forward_and_margin_trips_after_its_time) {
  CHECK(magnitude(kNeeded - to_q15(0.1365f + 0.055f + 0.38f)) < 10);
  CHECK(steps_to_implausible(kNeeded, 100'000) == 0);
  CHECK(steps_to_implausible(-kNeeded, -100'000) == 0);
  const int tripped = steps_to_implausible(kNeeded + 3000, 100'000);
  CHECK(tripped >= 300 && tripped < 450);
}

TEST(a_wheel_that_stands_is_left_to_the_other_monitor) {
  CHECK(steps_to_implausible(32'767, 0, 10'000) == 0);
  CHECK(steps_to_implausible(32'767, 0, 160) >= 300);
}

TEST(a_wheel_that_gains_speed_explains_its_duty) {
  PlausibilityMonitor monitor;
  int32_t speed = 0;
  for (int step = 0; step < 250; ++step) {
    speed += 1500;  // 1.5 m/s^2
    const int32_t duty =
        duty_for(speed, kDefaultGains.margin_q15, kNominal, kDefaultGains) + to_q15(0.143f * 1.2f);
    CHECK(!monitor.update(duty, speed, true, kNominal, kPeriod_us, 150'000, kDefaultGains));
  }
}

TEST(a_wheel_that_a_load_slows_down_needs_no_less_duty) {
  PlausibilityMonitor monitor;
  for (int step = 0; step < 400; ++step)
    CHECK(!monitor.update(0, 400'000, true, kNominal, kPeriod_us, 150'000, kDefaultGains));
  for (int32_t speed = 400'000; speed > 50'000; speed -= 1500) {
    const int32_t duty = duty_for(speed, kDefaultGains.margin_q15, kNominal, kDefaultGains);
    CHECK(!monitor.update(duty, speed, true, kNominal, kPeriod_us, 150'000, kDefaultGains));
  }
}

TEST(excess_adds_up_across_short_gaps) {
  struct Share {
    int excessive;
    int of;
    bool trips;
  };
  // An encoder that loses its edges for a while, again and again; and a moment now and then, which
  // leaks away, or which 100 ms that are plausible refute.
  for (const Share& share :
       {Share{14, 20, true}, Share{6, 20, true}, Share{1, 20, false}, Share{80, 200, false}}) {
    PlausibilityMonitor monitor;
    bool tripped = false;
    for (int step = 0; step < 10'000; ++step) {
      const int32_t duty = step % share.of < share.excessive ? kNeeded + 3000 : kNeeded;
      tripped |= trips(monitor, duty, 100'000);
    }
    CHECK(tripped == share.trips);
  }
}

TEST(a_stop_does_not_end_the_excess_and_a_clear_does) {
  PlausibilityMonitor monitor;
  const int first = steps_to_implausible(monitor, 32'767, 100'000);
  CHECK(first > 0 && first <= 600);
  for (int step = 0; step < 1000; ++step) monitor.rest(kPeriod_us);
  // A tenth of the time has leaked.
  const int again = steps_to_implausible(monitor, 32'767, 100'000);
  CHECK(again >= 100 && again < 300);
  monitor.end_evidence();
  CHECK(steps_to_implausible(monitor, 32'767, 100'000) >= 300);
}

TEST(an_impossible_speed_does_not_blind_the_check) {
  PlausibilityMonitor monitor;
  for (const int32_t speed : {200'000'000, INT32_MAX, INT32_MIN + 1})
    for (int step = 0; step < 500; ++step) CHECK(!trips(monitor, 32'767, speed));
  for (int step = 0; step < 500; ++step) trips(monitor, 0, 200'000'000);
  const int steps = steps_to_implausible(monitor, kNeeded + 3000, 100'000);
  CHECK(steps > 0 && steps <= 450);
}

TEST(the_duty_of_a_setpoint_is_limited_above_what_is_plausible) {
  const int32_t limit = duty_limit(100'000, kNominal, kDefaultGains);
  CHECK(magnitude(limit - to_q15(0.1365f + 0.055f + 0.475f)) < 10);
  CHECK(duty_limit(-100'000, kNominal, kDefaultGains) == limit);
  CHECK(while_accelerating(limit, -1500, kDefaultGains) > limit + 7000);
  CHECK(while_accelerating(limit, 0, kDefaultGains) == limit);
  CHECK(duty_limit(400'000, 3 * kNominal, kDefaultGains) == 32'767);
  CHECK(while_accelerating(30'000, INT32_MAX, kDefaultGains) == 32'767);
}

TEST(a_heavy_robot_is_plausible_for_as_long_as_it_gains_speed) {
  for (const int direction : {1, -1}) {
    for (const double heaviness : {1.0, 3.0, 6.0, 8.0})
      CHECK(steps_to_trip_from_rest(1.0, heaviness, direction) == 0);
    // Through a reversal, too.
    CHECK(steps_to_trip_from_rest(1.0, 6.0, direction, -0.4) == 0);
    // But there are bounds.
    CHECK(steps_to_trip_from_rest(1.0, 30.0, direction) != 0);
  }
}

TEST(speed_that_an_encoder_hides_is_not_taken_for_weight) {
  for (const int direction : {1, -1}) {
    for (const double seen : {0.01, 0.1, 0.3}) {
      const int tripped = steps_to_trip_from_rest(seen, 1.0, direction);
      CHECK(tripped >= 300 && tripped < 500);
    }
  }
}

TEST(a_heavy_robot_that_touches_an_obstacle_while_it_gains_speed_is_plausible) {
  const struct {
    double heaviness;  ///< So many times heavier than the feed-forward says.
    int at_ms;
    double left;  ///< What the obstacle leaves of the speed.
    int held_ms;
    double duty;
  } touches[] = {
      // It is slowed down,
      {4, 300, 0.3, 200, 0.85},
      {4, 300, 0.6, 120, 1.0},
      // stands at once,
      {6, 500, 0.0, 0, 1.0},
      {6, 800, 0.3, 200, 1.0},
      // or is held until ticks fail to come.
      {4, 200, 0.0, 200, 1.0},
      {6, 150, 0.0, 200, 0.85},
  };
  for (const auto& touch : touches) {
    for (const int direction : {1, -1}) {
      PlausibilityMonitor monitor;
      double speed_mps = 0;
      for (int ms = 1; ms <= 3000; ++ms) {
        if (ms == touch.at_ms) speed_mps *= touch.left;
        const bool is_held = ms >= touch.at_ms && ms < touch.at_ms + touch.held_ms;
        const double spare = touch.duty - 1.365 * speed_mps - 0.055;
        if (!is_held) speed_mps += spare / (0.143 * touch.heaviness) * 1e-3;
        const auto measured = static_cast<int32_t>(speed_mps * 1e6) * direction;
        const auto duty = static_cast<int32_t>(touch.duty * 32'767) * direction;
        CHECK(!trips(monitor, duty, measured, measured != 0));
      }
    }
  }
}
