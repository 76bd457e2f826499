// A simulated power stage: what its inputs make of the winding, by the data sheets.
#pragma once

#include "bridge.hpp"
#include "hal.hpp"

namespace wheelwire::sim {

/// What the stage does with these inputs. It knows nothing of the core's truth tables.
BridgeState state_of(Stage stage, const StageOutputs& inputs);

class Bridge final : public StagePort {
 public:
  explicit Bridge(Stage stage = Stage::kEnableIn1In2) : stage_(stage) {}

  void set(const StageOutputs& outputs) override;
  const BridgeState& state() const { return state_; }
  /// How often the winding was turned from one direction to the other, or shorted, without a
  /// control period in which the stage did not drive.
  uint32_t hard_switches() const { return hard_switches_; }

 private:
  Stage stage_;
  StageOutputs inputs_;
  BridgeState state_ = state_of(stage_, inputs_);
  uint32_t hard_switches_ = 0;
};

}  // namespace wheelwire::sim
