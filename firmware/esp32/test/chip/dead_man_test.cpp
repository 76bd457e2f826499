// What the dead-man's interrupt leaves of the outputs when no control step comes any more.
#include "dead_man.hpp"

#include "freertos/FreeRTOS.h"
#include "started_robot.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr int kLimit = checks_without_a_step(1000);
constexpr int kHoldMs = kMaxHoldUs / 1000;

/// A robot under the dead-man of one core, with a check each millisecond.
struct Watched {
  explicit Watched(const BoardDescription& board) : robot(board) {
    fake_core = 1;
    CHECK(dead_man.watch_from_this_core());
    dead_man.follow_period(1000);
    timer = fake_newest_timer;
  }
  Watched(const Watched&) = delete;

  /// Control steps that call `act` on both motors, each with its check.
  void steps(int count, bool drives, auto act) {
    for (int i = 0; i < count; ++i) {
      act(robot.left_motor);
      act(robot.right_motor);
      dead_man.feed(drives);
      fake_time_us += 1000;
      timer->ring();
    }
  }
  void brake() {
    steps(3, false, [](MotorPort& motor) { motor.brake(); });
  }

  /// The pins of the stages that are high at some time of a PWM period.
  PinMask high() { return high_pins() & stage_pins(robot.board); }
  bool is_released() { return !drives(robot.board); }

  StartedRobot robot;
  DeadMan dead_man;
  FakeGptimer* timer = nullptr;
};

void watch_every_stage(auto test) {
  on_every_stage([&](const BoardDescription& board) {
    power_on();
    Watched watched(board);
    test(watched);
  });
}

}  // namespace

TEST(a_brake_outlives_a_flash_operation_ends_at_the_slow_watchdog_s_limit_and_returns_with_a_step) {
  watch_every_stage([](Watched& watched) {
    watched.brake();
    const PinMask braked = watched.high();
    watched.timer->ring(kHoldMs);
    CHECK(watched.high() == braked);
    // The next step finds it so, and the next operation has its whole time.
    watched.brake();
    watched.timer->ring(kHoldMs);
    CHECK(watched.high() == braked);
    watched.timer->ring(kLimit);
    CHECK(watched.is_released());
    watched.brake();
    CHECK(watched.high() == braked);
  });
}

TEST(a_robot_that_drives_either_way_is_released_after_a_few_checks_and_drives_with_a_step) {
  watch_every_stage([](Watched& watched) {
    for (const int16_t duty_q15 : std::initializer_list<int16_t>{20'000, -20'000, 20'000}) {
      watched.steps(3, true, [=](MotorPort& motor) { motor.drive(duty_q15); });
      CHECK(!watched.is_released());
      watched.timer->ring(kLimit - 1);
      CHECK(!watched.is_released());
      watched.timer->ring();
      CHECK(watched.is_released());
    }
  });
}
