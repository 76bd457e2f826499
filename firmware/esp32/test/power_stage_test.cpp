#include "power_stage.hpp"

#include <vector>

#include "check.hpp"

using namespace wheelwire;

namespace {

constexpr uint16_t kHigh = kHigh_q15;

constexpr const StageTable& table(Stage stage) { return kStageTables[static_cast<size_t>(stage)]; }

/// In the order of StageInput.
constexpr StageOutputs inputs(uint16_t enable, uint16_t in1, uint16_t in2, uint16_t pwm = 0,
                              uint16_t dir = 0) {
  return {{enable, in1, in2, pwm, dir}};
}

class Port final : public StagePort {
 public:
  void set(const StageOutputs& outputs) override { now = outputs; }
  StageOutputs now;
};

/// The inputs after each of two calls for an action, from a stage that coasts.
StageOutputs after(Stage stage, auto act) {
  Port port;
  PowerStage motor(port, table(stage));
  act(motor);
  act(motor);
  return port.now;
}

constexpr int16_t kDuty = 1000;
void drive_forward(PowerStage& motor) { motor.drive(kDuty); }
void reverse(PowerStage& motor) { motor.drive(-kDuty); }
void brake(PowerStage& motor) { motor.brake(); }
void coast(PowerStage& motor) { motor.coast(); }

}  // namespace

TEST(stage_truth_tables_are_those_of_the_data_sheets) {
  const struct {
    Stage stage;
    StageOutputs forward, reverse, brake, coast;
  } rows[] = {
      {Stage::kEnableIn1In2, inputs(kDuty, kHigh, 0), inputs(kDuty, 0, kHigh), inputs(kHigh, 0, 0),
       inputs(0, 0, 0)},
      {Stage::kPwmIn1In2, inputs(0, kHigh, 0, kDuty), inputs(0, 0, kHigh, kDuty),
       inputs(0, kHigh, kHigh, 0), inputs(0, 0, 0)},
      {Stage::kInIn, inputs(0, kDuty, 0), inputs(0, 0, kDuty), inputs(0, kHigh, kHigh),
       inputs(0, 0, 0)},
      {Stage::kHalfBridges, inputs(kHigh, kDuty, 0), inputs(kHigh, 0, kDuty), inputs(kHigh, 0, 0),
       inputs(0, 0, 0)},
      {Stage::kPwmDir, inputs(0, 0, 0, kDuty, kHigh), inputs(0, 0, 0, kDuty, 0), inputs(0, 0, 0),
       inputs(0, 0, 0)},
  };
  static_assert(sizeof rows / sizeof rows[0] == kStages);
  for (const auto& row : rows) {
    CHECK(after(row.stage, drive_forward) == row.forward);
    CHECK(after(row.stage, reverse) == row.reverse);
    CHECK(after(row.stage, brake) == row.brake);
    CHECK(after(row.stage, coast) == row.coast);
  }
}

TEST(stages_coast_for_one_period_between_two_actions) {
  using Act = void (*)(PowerStage&);
  const Act actions[] = {drive_forward, reverse, brake};
  for (size_t i = 0; i < kStages; ++i) {
    for (const Act first : actions) {
      for (const Act then : actions) {
        if (first == then) continue;
        Port port;
        PowerStage motor(port, kStageTables[i]);
        first(motor);
        const StageOutputs before = port.now;
        then(motor);
        const StageOutputs between = port.now;
        motor.coast();
        CHECK(port.now == between);
        then(motor);
        CHECK(port.now != before);
        // Once it coasts, it takes up the action at once.
        motor.coast();
        then(motor);
        CHECK(port.now == after(static_cast<Stage>(i), then));
      }
    }
  }
}

TEST(stage_zero_duty_coasts) {
  for (const StageTable& stage : kStageTables) {
    Port port;
    PowerStage motor(port, stage);
    motor.drive(5);
    for (int i = 0; i < 3; ++i) {
      motor.drive(0);
      for (size_t input = 0; input < kStageInputs; ++input) {
        const bool switches =
            stage.rows[static_cast<size_t>(StageAction::kForward)][input] == StageLevel::kPwm;
        CHECK(!switches || port.now.duty_q15[input] == 0);
      }
    }
  }
}

TEST(changes_come_in_an_order_that_never_drives_by_accident) {
  using enum StageInput;
  std::vector<StageInput> order;
  const auto note = [&order](StageInput input, uint16_t) { order.push_back(input); };
  for_each_input(inputs(0, kHigh, 0), inputs(kDuty, 0, kHigh), note);
  CHECK((order == std::vector{kIn1, kDir, kPwm, kIn2, kEnable}));
  order.clear();
  for_each_input(inputs(kDuty, kHigh, 0), inputs(0, kHigh, 0), note);
  CHECK((order == std::vector{kEnable, kDir, kPwm, kIn2, kIn1}));
  order.clear();
  for_each_input(inputs(0, 0, 0), inputs(0, 0, 0, kDuty, kHigh), note);
  CHECK((order == std::vector{kDir, kPwm, kIn2, kIn1, kEnable}));
}
