// Each parameter arrives in the control loop, in its unit there.
#include "config.hpp"

#include "check.hpp"

using namespace wheelwire;
using enum ParameterId;

namespace {

ControlConfig config_with(ParameterId id, float value) {
  Parameters parameters;
  CHECK(parameters.set(id, value) == RefusalCode::kNone);
  return make_config(parameters);
}

}  // namespace

TEST(each_parameter_arrives_in_its_unit) {
  CHECK(config_with(kControlRateHz, 500).period_us == 2000);
  CHECK(config_with(kVelocityWindowUs, 12'345).velocity_window_us == 12'345);
  CHECK(config_with(kBrakeTimeS, 0.25f).brake_time_us == 250'000);
  CHECK(config_with(kTtlMaxS, 0.75f).ttl_max_us == 750'000);
  CHECK(config_with(kOverrunLimitUs, 12'345).overrun_limit_us == 12'345);
  CHECK(config_with(kStallTimeS, 1.5f).faults.stall_time_us == 1'500'000);
  // By control step.
  CHECK(config_with(kMaxVelocityMps, 0.25f).max_velocity_umps == 250'000);
  CHECK(config_with(kMaxAccelerationMps2, 2).velocity_slew_umps == 2'000);
  CHECK(magnitude(config_with(kMaxDutyRatePerS, 10).duty_slew_q15 - 328) <= 1);
  CHECK(config_with(kMaxAccelerationMps2, 0.05f).velocity_slew_umps == 50);
  CHECK(magnitude(config_with(kMaxDuty, 0.5f).gains.limit_q15 - 16'384) <= 1);
  CHECK(magnitude(config_with(kStallDuty, 0.25f).faults.stall_duty_q15 - 8'192) <= 1);
  CHECK(magnitude(config_with(kReversalDuty, 0.25f).faults.reversal_duty_q15 - 8'192) <= 1);
  CHECK(config_with(kReversalVelocityMps, 0.25f).faults.reversal_umps == 250'000);
}

TEST(a_slew_limit_never_becomes_zero) {
  Parameters parameters;
  CHECK(parameters.set(kMaxDutyRatePerS, 0.5f) == RefusalCode::kNone);
  CHECK(parameters.set(kControlRateHz, 5000) == RefusalCode::kNone);
  CHECK(make_config(parameters).duty_slew_q15 >= 1);
}

TEST(a_tick_is_the_rim_between_two_counts) {
  Parameters parameters;
  CHECK(parameters.set(kWheelRadius, 0.05f) == RefusalCode::kNone);
  CHECK(parameters.set(kCountsPerRevolution, 1000) == RefusalCode::kNone);
  CHECK(magnitude(make_config(parameters).um_per_tick_q10 - 321'699) <= 1);  // 2 pi 50 mm / 1000
}
