// One half of an L298N as a motor port.
#pragma once

#include "hal.hpp"

namespace wheelwire {

/// With EN high: IN1 alone drives forward, IN2 alone reverse, both equal brake. EN low coasts.
class L298n final : public MotorPort {
 public:
  explicit L298n(BridgePort& pins) : pins_(pins) {}

  /// Call drive() or brake() once per control period, but not in the first period after a coast()
  /// that came between two periods: a change of direction takes one whole period with EN low, so
  /// that the inputs never switch while current flows.
  void drive(int16_t duty_q15) override;
  void brake() override;
  void coast() override;

 private:
  enum class Inputs : uint8_t { kUnset, kForward, kReverse, kBrake };

  bool switch_inputs(Inputs wanted);

  BridgePort& pins_;
  Inputs inputs_ = Inputs::kUnset;
  bool enabled_ = false;
};

}  // namespace wheelwire
