#include "path.hpp"

#include "following_error.hpp"
#include "robot_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr PathGains kPathGains{
    .path_q16 = 2 * 65'536, .heading_q16 = 10 * 65'536, .catch_up_q15 = 983, .limit_um = 50'000};
constexpr int32_t kTick_q10 = 576 * 1024;

/// The error of a wheel that is asked for this speed from its second step on.
struct Follower : FollowingError {
  explicit Follower(int32_t target_umps) {
    run(1);
    set_target(target_umps);
  }
  /// Steps, each of which brings these ticks.
  void run(int steps, int32_t ticks = 0) {
    for (int i = 0; i < steps; ++i) update(ticks, ++step * 1000, kPeriod_us, kTick_q10);
  }
  int32_t least_umps() const { return minimum_umps(kTick_q10); }

  uint64_t step = 0;
};

}  // namespace

TEST(the_wheel_ahead_waits_and_the_one_behind_hurries_a_little) {
  const WheelPair command = correct_setpoint({200'000, 200'000}, {10'000, 0}, kPathGains);
  CHECK(command.left == 200'000 + 5999);  // 3 %
  CHECK(command.right == 100'000);
}

TEST(no_correction_turns_a_wheel_back) {
  const WheelPair forward = correct_setpoint({200'000, 200'000}, {50'000, 0}, kPathGains);
  CHECK(forward.right == 0);
  const WheelPair backward = correct_setpoint({-200'000, -200'000}, {-50'000, 0}, kPathGains);
  CHECK(backward.right == 0 && backward.left < -200'000);
  const WheelPair standing = correct_setpoint({0, 100'000}, {20'000, 20'000}, kPathGains);
  CHECK(standing.left == 0);
}

TEST(a_reversed_setpoint_forgets_and_a_saturated_wheel_keeps_the_heading_only) {
  const WheelPair reversed = trim_errors({10'000, 4000}, {1, 1}, false, false, kPathGains);
  CHECK(reversed.left == 0 && reversed.right == 0);
  const WheelPair saturated = trim_errors({10'000, 4000}, {1, 1}, true, true, kPathGains);
  CHECK(saturated.left == 3000 && saturated.right == -3000);
  const WheelPair bounded = trim_errors({900'000, -900'000}, {1, 1}, true, false, kPathGains);
  CHECK(bounded.left == 50'000 && bounded.right == -50'000);
}

TEST(a_saturated_wheel_makes_the_robot_late_on_the_same_curve) {
  // The right wheel covers half of its way: the left one, at half of its speed, is right to do so.
  for (const int direction : {1, -1}) {
    const WheelPair curve{100'000 * direction, 300'000 * direction};
    const WheelPair late =
        trim_errors({5000 * direction, 15'000 * direction}, curve, true, true, kPathGains);
    CHECK(magnitude(late.left) <= 100 && magnitude(late.right) <= 100);
    const WheelPair ahead = trim_errors({0, 15'000 * direction}, curve, true, true, kPathGains);
    CHECK(ahead.left * direction < -3000 && ahead.right == -ahead.left);
  }
  // A turn on the spot has no way that it could be late on.
  const WheelPair spin =
      trim_errors({-10'000, 10'000}, {-300'000, 100'000}, true, true, kPathGains);
  CHECK(spin.left == -10'000 && spin.right == 10'000);
}

TEST(without_gains_nothing_is_made_up) {
  const PathGains off{};
  CHECK(!off.follows());
  CHECK(correct_setpoint({200'000, -1}, {10'000, 10'000}, off).left == 200'000);
}

TEST(a_wheel_that_keeps_up_shows_no_error_between_its_ticks) {
  FollowingError error;
  error.set_target(30'000);
  for (uint64_t step = 1; step <= 20'000; ++step) {
    const auto now = static_cast<int64_t>(step * 30 / 576);
    const auto before = static_cast<int64_t>((step - 1) * 30 / 576);
    error.update(static_cast<int32_t>(now - before), step * 1000, kPeriod_us, kTick_q10);
    CHECK(error.um() == 0);
    CHECK(error.minimum_umps(kTick_q10) == 0);
  }
}

TEST(a_wheel_that_stands_falls_behind_by_its_whole_setpoint) {
  Follower error(-100'000);
  error.run(1000);
  CHECK(magnitude(error.um() + 100'000) < 1000);
  CHECK(magnitude(error.least_umps() + 100'000) < 1000);
  error.trim_to(-2000);
  error.run(1);
  CHECK(magnitude(error.um() + 2000) <= 101);
}

TEST(ticks_to_and_fro_are_no_progress) {
  Follower error(100'000);
  for (int i = 0; i < 500; ++i) error.run(1, i % 2 == 0 ? 1 : -1);
  CHECK(error.least_umps() > 90'000);
}

TEST(a_wheel_that_is_pushed_at_rest_is_not_behind) {
  Follower error(100'000);
  error.run(100);
  error.rest();
  const int32_t before_um = error.um();
  const uint32_t before_q4 = error.total_q4();
  error.run(100, -1);
  CHECK(magnitude(error.um() - before_um) < 1000);
  CHECK(error.total_q4() == before_q4);
}

TEST(a_late_step_counts_as_the_longest_one) {
  Follower error(400'000);
  error.update(0, 61'000, kPeriod_us, kTick_q10);
  CHECK(error.um() > 10'000 && error.um() < 12'400);
}

TEST(while_no_tick_comes_the_next_one_may_be_about_to) {
  Follower error(100'000);
  error.run(10);
  // 1000 um asked in 10 ms, of which 576 um may have been rolled.
  CHECK(magnitude(error.least_umps() - 42'400) < 200);
}
