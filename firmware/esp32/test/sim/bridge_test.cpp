#include <cmath>

#include "bridge_port.hpp"
#include "check.hpp"
#include "power_stage.hpp"

using namespace wheelwire;
using namespace wheelwire::sim;

namespace {

constexpr double kWinding = 5.0;  // [Ohm]
constexpr int16_t kHalf = kHigh_q15 / 2 + 1;

/// Keeps the inputs that a stage would get.
class StageLevels final : public StagePort {
 public:
  void set(const StageOutputs& outputs) override { last = outputs; }
  StageOutputs last;
};

double current(const BridgeState& state, double emf, const BridgeModel& model = {}) {
  return model.current(state, emf, kWinding);
}

BridgeState forward(double duty, Winding off = Winding::kOpen) {
  return {.on = Winding::kForward, .off = off, .duty = duty};
}
constexpr BridgeState kCoasting;
constexpr BridgeState kBraking{.on = Winding::kShorted, .off = Winding::kShorted, .duty = 1.0};

}  // namespace

TEST(bridge_drives_by_its_state_brakes_shorted_above_its_own_drop_and_coasts_open) {
  CHECK(current(forward(1.0), 0.0) > 0.5);
  CHECK(current({.on = Winding::kReverse, .duty = 1.0}, 0.0) < -0.5);
  CHECK(current(kBraking, 4.0) < -0.2);
  CHECK(current(kBraking, -4.0) > 0.2);
  CHECK(current(kBraking, 1.0) == 0.0);
  CHECK(current(kCoasting, 4.0) == 0.0);
}

TEST(bridge_drop_is_within_the_datasheet) {
  // A winding that lets `amperes` flow at standstill shows the drop in what it does not get.
  for (const double amperes : {1.0, 2.0}) {
    BridgeModel model;
    model.supply_v = 12.0;
    const double ohm = (model.supply_v - model.drop_v) / amperes - model.drop_ohm;
    const double flowing = model.current(forward(1.0), 0.0, ohm);
    CHECK(flowing > 0.999 * amperes && flowing < 1.001 * amperes);
    const double drop = model.supply_v - flowing * ohm;
    CHECK(amperes > 1.0 ? drop < 4.9 : drop > 1.8 && drop < 3.2);
  }
}

TEST(bridge_averages_or_chops_the_voltage) {
  BridgeModel chopped;
  chopped.chopped = true;
  CHECK(current(forward(0.5), 4.0) < 0.0);           // Faster than half the voltage: it brakes,
  CHECK(current(forward(0.5), 4.0, chopped) > 0.0);  // unless the current dies out in between.
  CHECK(current(forward(0.5), 7.0, chopped) == 0.0);
  // Where the off time shorts the winding, no current dies out.
  CHECK(current(forward(0.5, Winding::kShorted), 4.0, chopped) < 0.0);
}

TEST(bridge_counts_a_reversal_without_a_pause) {
  for (size_t i = 0; i < kStages; ++i) {
    Bridge bridge(static_cast<Stage>(i));
    StageLevels forward_inputs;
    StageLevels reverse_inputs;
    PowerStage to_forward(forward_inputs, kStageTables[i]);
    PowerStage to_reverse(reverse_inputs, kStageTables[i]);
    to_forward.drive(kHalf);
    to_reverse.drive(-kHalf);
    bridge.set(forward_inputs.last);
    bridge.set(reverse_inputs.last);
    CHECK(bridge.hard_switches() == 1);
  }
}

/// Between high and low the PWM of a direction input turns the winding: the motor sees the average.
TEST(bridge_with_the_pwm_on_a_direction_alternates) {
  StageOutputs inputs;
  inputs.duty_q15[static_cast<size_t>(StageInput::kPwm)] = kHigh_q15;
  for (const double duty : {0.25, 0.5, 0.75}) {
    inputs.duty_q15[static_cast<size_t>(StageInput::kDir)] =
        static_cast<uint16_t>(duty * kHigh_q15);
    const BridgeState state = state_of(Stage::kPwmDir, inputs);
    CHECK(state.drives() && state.alternates());
    CHECK(std::abs(state.signed_duty() - (2.0 * duty - 1.0)) < 1e-3);
    const double expected = (2.0 * duty - 1.0) * (BridgeModel{}.supply_v - BridgeModel{}.drop_v) /
                            (kWinding + BridgeModel{}.drop_ohm);
    CHECK(std::abs(current(state, 0.0) - expected) < 1e-3);
  }
}

TEST(bridge_with_several_duties_gets_their_average) {
  const auto with = [](double enable, double in1, double in2) {
    StageOutputs inputs;
    inputs.duty_q15[0] = static_cast<uint16_t>(enable * kHigh_q15);
    inputs.duty_q15[1] = static_cast<uint16_t>(in1 * kHigh_q15);
    inputs.duty_q15[2] = static_cast<uint16_t>(in2 * kHigh_q15);
    return inputs;
  };
  const auto near = [](double value, double wanted) { return std::abs(value - wanted) < 1e-3; };
  // Until 0.25 forward, then shorted, from 0.5 on open.
  const BridgeState both = state_of(Stage::kEnableIn1In2, with(0.5, 0.25, 0.0));
  CHECK(near(both.signed_duty(), 0.25) && both.off == Winding::kShorted);
  // Shorted while both are high, then reverse until the enable ends.
  const BridgeState last = state_of(Stage::kHalfBridges, with(0.75, 0.25, 1.0));
  CHECK(near(last.signed_duty(), -0.5));
  // Only shorted and open.
  const BridgeState none = state_of(Stage::kInIn, with(0.0, 0.3, 0.3));
  CHECK(!none.drives() && near(none.shorted(), 0.3));
}
