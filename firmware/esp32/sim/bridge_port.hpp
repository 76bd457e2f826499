// A simulated power stage: what its inputs make of the winding, by the data sheets.
#pragma once

#include "bridge.hpp"
#include "hal.hpp"

namespace wheelwire::sim {

/// What the stage does with these inputs; standby, where it has such an input, switches it off
/// while low. It knows nothing of the core's truth tables: any input may carry a PWM.
BridgeState state_of(Stage stage, const StageOutputs& inputs, uint16_t standby_q15 = kHigh_q15);

class Bridge final : public StagePort {
 public:
  explicit Bridge(Stage stage = Stage::kEnableIn1In2) : stage_(stage) {}

  void set(const StageOutputs& outputs) override { apply(outputs, kHigh_q15); }
  void apply(const StageOutputs& inputs, uint16_t standby_q15);
  const BridgeState& state() const { return state_; }
  /// How often the winding was turned from one direction to the other, or shorted, without a
  /// control period in which the stage did not drive.
  uint32_t hard_switches() const { return hard_switches_; }

 private:
  Stage stage_;
  StageOutputs inputs_;
  uint16_t standby_q15_ = kHigh_q15;
  BridgeState state_ = state_of(stage_, inputs_);
  uint32_t hard_switches_ = 0;
};

}  // namespace wheelwire::sim
