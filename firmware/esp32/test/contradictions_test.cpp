#include "contradictions.hpp"

#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using namespace wheelwire::test;

namespace {

uint32_t with(std::initializer_list<std::pair<ParameterId, float>> values, uint32_t max_pwm_hz) {
  Parameters parameters;
  for (const auto& [id, value] : values) CHECK(parameters.set(id, value) == RefusalCode::kNone);
  return contradictions(parameters, max_pwm_hz);
}

}  // namespace

TEST(each_contradiction_has_its_flag_and_its_boundary) {
  CHECK(with({}, 20'000) == 0);
  CHECK(with({{kControlRateHz, 100}, {kOverrunLimitUs, 14'999}}, 0) ==
        contradiction::kOverrunLimit);
  CHECK(with({{kControlRateHz, 100}, {kOverrunLimitUs, 15'000}}, 0) == 0);
  CHECK(with({{kPwmFrequencyHz, 20'001}}, 20'000) == contradiction::kPwmFrequency);
  CHECK(with({{kPwmFrequencyHz, 40'000}}, 0) == 0);  // The stage is not known.
  CHECK(with({{kStreamRateHz, 1001}}, 0) == contradiction::kStreamRate);
  CHECK(with({{kStreamRateHz, 1000}}, 0) == 0);
  CHECK(with({{kNominalSupplyV, 1.3f}}, 0) == contradiction::kSupplyDrop);
  CHECK(with({{kUnmeasuredSupplyV, 1.0f}}, 0) == contradiction::kSupplyDrop);
  CHECK(with({{kCountsPerRevolution, 200'000}, {kMaxVelocityMps, 10}, {kGlitchFilterNs, 0}}, 0) ==
        0);
  CHECK(with({{kCountsPerRevolution, 200'000},
              {kMaxVelocityMps, 10},
              {kWheelRadius, 0.01f},
              {kGlitchFilterNs, 0}},
             0) == contradiction::kTickRate);
  CHECK(with({{kCountsPerRevolution, 200'000}, {kGlitchFilterNs, 2500}}, 0) == 0);
  CHECK(with({{kCountsPerRevolution, 200'000}, {kGlitchFilterNs, 2700}}, 0) ==
        contradiction::kGlitchFilter);
}

TEST(values_on_trial_are_judged_together_at_rest_and_at_once_while_it_drives) {
  OpenRobot bench;
  const ParameterTrial begin{.action = TrialAction::kBegin, .timeout_s = 5.0f};
  const ParameterTrial keep{.action = TrialAction::kKeep};
  CHECK(bench.refusal(begin) == RefusalCode::kNone);
  CHECK(bench.set(kStreamRateHz, 2000) == RefusalCode::kNone);
  // Until the other value is there nothing drives, and a KEEP is refused.
  bench.drive(0.1f, 0.1f);
  CHECK(!bench.driven() && bench.last_refusal() == RefusalCode::kContradiction);
  CHECK(bench.refusal(keep) == RefusalCode::kContradiction);
  CHECK(bench.set(kControlRateHz, 2000) == RefusalCode::kNone);
  CHECK(bench.refusal(keep) == RefusalCode::kNone);
  CHECK(bench.refusal(begin) == RefusalCode::kNone);
  bench.drive(0.1f, 0.1f);
  CHECK(bench.driven() && bench.set(kStreamRateHz, 3000) == RefusalCode::kContradiction);
  CHECK(bench.driven());
}
