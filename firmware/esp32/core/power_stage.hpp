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
  void drive(int16_t duty_q15) override;
  void brake() override { take(StageAction::kBrake, kHigh_q15); }
  /// Where the stage cannot coast, it brakes.
  void coast() override;

 private:
  void take(StageAction action, uint16_t duty_q15);
  void set(StageAction action, uint16_t duty_q15);

  StagePort& port_;
  const StageTable& table_;
  StageOutputs outputs_;
  size_t pwm_ = 0;                          ///< The input that takes the duty.
  StageAction last_ = StageAction::kCoast;  ///< The last action but coasting.
  bool coasting_ = true;
};

}  // namespace wheelwire
