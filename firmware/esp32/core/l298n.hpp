// One half of an L298N as a motor port.
#pragma once

#include "hal.hpp"

namespace wheelwire {

/// Truth table with EN high: IN1 only forward, IN2 only reverse, both alike brake. EN low coasts.
class L298n final : public MotorPort {
 public:
  explicit L298n(BridgePort& pins) : pins_(pins) {}

  /// Call these two once per control period, and not in the one after a coast() between two: a
  /// change of direction spends one period with EN low, so that the inputs never switch under
  /// current.
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
