// A wheel ends what its parts have begun whenever it stops or is driven in another way.
#include "wheel.hpp"

#include "robot_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;
using enum ParameterId;

namespace {

/// A wheel whose encoder counts what the test says.
class WheelBench {
 public:
  WheelFault latch(int ticks = 0) {
    now_us_ += config.period_us;
    counter_ = static_cast<int16_t>(counter_ + ticks);
    return wheel.latch(counter_, now_us_, false, kNominal, config);
  }
  /// A control step of the closed loop at this setpoint.
  WheelFault velocity(int32_t setpoint_umps, int ticks = 0) {
    const WheelFault fault = latch(ticks);
    wheel.drive_velocity(setpoint_umps, setpoint_umps, false, kNominal, config);
    return fault;
  }
  WheelFault duty(int32_t duty_q15, int ticks = 0) {
    const WheelFault fault = latch(ticks);
    wheel.drive_duty(duty_q15, false);
    return fault;
  }
  /// The steps of the closed loop until a fault, of a wheel that ticks every so many; 0: none.
  int steps_to_fault(WheelFault expected, int tick_every, int most = 5000) {
    for (int step = 1; step < most; ++step) {
      const WheelFault fault = velocity(kSetpoint_umps, tick_every && step % tick_every == 0);
      if (fault != WheelFault::kNone) return fault == expected ? step : -1;
    }
    return 0;
  }

  static constexpr int32_t kSetpoint_umps = 300'000;
  ControlConfig config = make_config(Parameters());
  BenchMotor motor;
  Wheel wheel{motor};

 private:
  uint64_t now_us_ = 1'000'000;
  int16_t counter_ = 0;
};

/// The ways in which a wheel's drive ends; the last one ends its closed loop alone.
constexpr void (*kEnds[])(Wheel&) = {
    [](Wheel& wheel) { wheel.coast(); },
    [](Wheel& wheel) { wheel.brake(); },
    [](Wheel& wheel) { wheel.drive_duty(0, false); },
};

}  // namespace

TEST(what_a_wheel_showed_outlives_each_end_of_its_drive_but_no_clear) {
  const ControlConfig config = WheelBench().config;
  const struct {
    WheelFault fault;
    int tick_every;
    uint32_t time_us;
    size_t ends;
  } shown[] = {
      // An encoder that loses edges: seldom a tick at a high duty.
      {WheelFault::kImplausible, 40, config.plausibility_time_us, 3},
      {WheelFault::kNotCounting, 0, config.faults.stall_time_us, 2},
  };
  for (const auto& [fault, tick_every, time_us, ends] : shown) {
    const auto least = static_cast<int>(time_us / 1000);
    const int fresh = WheelBench().steps_to_fault(fault, tick_every);
    CHECK(fresh >= least);
    for (size_t i = 0; i < ends; ++i) {
      WheelBench bench;
      CHECK(bench.steps_to_fault(fault, tick_every, fresh - 10) == 0);
      kEnds[i](bench.wheel);
      WheelBench cleared = bench;
      const int again = bench.steps_to_fault(fault, tick_every);
      CHECK(again > 0 && again < least);
      cleared.wheel.end_evidence();
      CHECK(cleared.steps_to_fault(fault, tick_every) >= least);
    }
  }
}

TEST(the_duty_of_an_open_loop_is_not_judged_by_the_limit_of_the_closed_one) {
  WheelBench bench;
  // Too little for a stall, but as much as the loop would give at most.
  const int32_t duty = bench.config.faults.stall_duty_q15 - 100;
  bench.config.gains.limit_q15 = duty;
  for (int step = 0; step < 50; ++step) bench.velocity(50'000);
  for (int step = 0; step < 5000; ++step) CHECK(bench.duty(duty) == WheelFault::kNone);
}

TEST(feedback_that_is_inverted_is_found_whatever_was_the_setpoint_before) {
  for (const int32_t before : {-100'000, 0, 100'000}) {
    WheelBench bench;
    for (int step = 0; step < 20; ++step) bench.velocity(before);
    bench.duty(32'767);
    WheelFault fault = WheelFault::kNone;
    // Driven forwards it counts ever faster backwards.
    for (int step = 1; step < 400 && fault == WheelFault::kNone; ++step)
      fault = bench.duty(32'767, -(step / 50));
    CHECK(fault == WheelFault::kReversed);
  }
}

TEST(driven_by_duty_a_wheel_falls_no_further_behind_its_last_setpoint) {
  WheelBench bench;
  CHECK(bench.config.path.follows());
  for (int step = 0; step < 10; ++step) bench.velocity(WheelBench::kSetpoint_umps);
  bench.duty(0);
  const int32_t behind = bench.wheel.behind_um();
  for (int step = 0; step < 500; ++step) bench.duty(0);
  CHECK(magnitude(bench.wheel.behind_um() - behind) < 1000);
}
