// One wheel's power stage as a motor port. Its truth table is data: a stage is added to `STAGES` in
// protocol/wheelwire_protocol/power_stages.py.
#pragma once

#include "board_tables.hpp"
#include "hal.hpp"

namespace wheelwire {

class PowerStage final : public MotorPort {
 public:
  explicit PowerStage(StagePort& port, const StageTable& table = kStageTables[0])
      : port_(port), table_(table) {}

  /// Call drive() or brake() once per control period, but not in the first period after a coast()
  /// that came between two periods: from one action to another the stage coasts for one whole
  /// period, so that no input changes while current flows.
  void drive(int16_t duty_q15) override {
    if (duty_q15 == 0) {
      coast();
    } else if (duty_q15 > 0) {
      take(StageAction::kForward, static_cast<uint16_t>(duty_q15));
    } else {
      take(StageAction::kReverse, static_cast<uint16_t>(-duty_q15));
    }
  }
  void brake() override { take(StageAction::kBrake, kHigh_q15); }
  /// Where the stage cannot coast, it brakes.
  void coast() override {
    set(StageAction::kCoast, 0);
    coasting_ = true;
  }

 private:
  void take(StageAction action, uint16_t duty_q15) {
    if (action != last_ && !coasting_) {
      coast();
      return;
    }
    if (action == last_ && !coasting_) {
      // All else is as it was: most steps come here.
      if (action != StageAction::kBrake) outputs_.duty_q15[pwm_] = duty_q15;
      port_.set(outputs_);
      return;
    }
    set(action, duty_q15);
    last_ = action;
    coasting_ = false;
  }
  void set(StageAction action, uint16_t duty_q15) {
    const StageLevel* const row = table_.rows[static_cast<size_t>(action)];
    for (size_t i = 0; i < kStageInputs; ++i) {
      switch (row[i]) {
        case StageLevel::kLow:
          outputs_.duty_q15[i] = 0;
          break;
        case StageLevel::kHigh:
          outputs_.duty_q15[i] = kHigh_q15;
          break;
        case StageLevel::kPwm:
          outputs_.duty_q15[i] = duty_q15;
          pwm_ = i;
          break;
        case StageLevel::kKeep:
          break;
      }
    }
    port_.set(outputs_);
  }

  StagePort& port_;
  const StageTable& table_;
  StageOutputs outputs_;
  size_t pwm_ = 0;                          ///< The input that takes the duty.
  StageAction last_ = StageAction::kCoast;  ///< The last action but coasting.
  bool coasting_ = true;
};

}  // namespace wheelwire
