#include "drive.hpp"
#include "robot_bench.hpp"
#include "slew.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr ControllerGains kPlainGains{
    .proportional_q24 = 549'739,  // 1 duty per m/s
    .integral_q32 = 1'125'900,    // 8 duty per m, at 1 kHz
    .feedforward_q24 = 795'472,   // 1.447 duty per m/s
    .acceleration_q24 = 0,
    .delay_steps = 13,
    .static_q15 = 0,
    .margin_q15 = 32'767,
    .limit_q15 = 32'767,
    .slew_umps = 1500,
    .memory_shift = 8,
};

}  // namespace

TEST(feed_forward_alone_gives_the_duty_of_the_no_load_line) {
  Controller controller;
  controller.reset(400'000);
  const int32_t duty = controller.update(400'000, 0, kNominal, kPlainGains);
  CHECK(magnitude(duty - 18'965) <= 2);  // 0.4 m/s x 1.447 = 0.5788
}

TEST(the_integral_does_not_wind_up_against_the_limit) {
  Controller controller;
  for (int i = 0; i < 10'000; ++i)
    CHECK(controller.update(400'000, 400'000, kNominal, kPlainGains) <= 32'767);
  int steps = 0;
  while (controller.update(400'000, -100'000, kNominal, kPlainGains) > 18'965 && steps < 2000)
    ++steps;
  CHECK(steps < 1000);
}

TEST(extreme_inputs_stay_within_the_limit) {
  for (const int32_t limit_q15 : {32'767, 9'830}) {
    ControllerGains gains = kPlainGains;
    gains.limit_q15 = limit_q15;
    Controller controller;
    for (const int32_t target : {INT32_MAX, -INT32_MAX, 0}) {
      for (const int32_t error : {INT32_MAX, -INT32_MAX, 0})
        CHECK(magnitude(controller.update(target, error, kNominal, gains)) <= limit_q15);
    }
  }
}

TEST(scaling_keeps_the_ratio) {
  const WheelPair scaled = scale_to_limit({250'000, 550'000}, 400'000);
  CHECK(scaled.right == 400'000);
  CHECK(magnitude(scaled.left - 181'818) <= 1);
  const WheelPair untouched = scale_to_limit({-400'000, 100}, 400'000);
  CHECK(untouched.left == -400'000 && untouched.right == 100);
}

TEST(both_wheels_arrive_together) {
  WheelPair at{0, 0};
  const WheelPair to{-100'000, 400'000};
  int steps = 0;
  while (at.right != to.right) {
    at = approach(at, to, 1500);
    CHECK(magnitude(at.left + at.right / 4) <= 300);  // the path's curvature all the way
    ++steps;
  }
  CHECK(at.left == to.left);
  CHECK(steps == 267);
}
