#include "power_stage.hpp"

namespace wheelwire {

void PowerStage::drive(int16_t duty_q15) {
  if (duty_q15 == 0) {
    coast();
  } else if (duty_q15 > 0) {
    take(StageAction::kForward, static_cast<uint16_t>(duty_q15));
  } else {
    take(StageAction::kReverse, static_cast<uint16_t>(-duty_q15));
  }
}

void PowerStage::coast() {
  set(StageAction::kCoast, 0);
  coasting_ = true;
}

void PowerStage::take(StageAction action, uint16_t duty_q15) {
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

void PowerStage::set(StageAction action, uint16_t duty_q15) {
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

}  // namespace wheelwire
