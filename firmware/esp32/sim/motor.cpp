#include "motor.hpp"

#include <numbers>

namespace wheelwire::sim {

MotorConstants derive(const MotorRating& rating, const BridgeModel& bridge,
                      const Friction& friction) {
  const double drop_ohm = rating.at_terminals ? 0.0 : bridge.drop_ohm;
  const double voltage = rating.supply_v - (rating.at_terminals ? 0.0 : bridge.drop_v);
  const double circuit_ohm = voltage / rating.stall_current_a;
  const double torque_per_amp = rating.stall_torque_nm / rating.stall_current_a;
  const double no_load_speed = rating.no_load_rpm * 2.0 * std::numbers::pi / 60.0;
  const double no_load_current = friction.torque(no_load_speed) / torque_per_amp;
  return {
      .winding_ohm = circuit_ohm - drop_ohm,
      .torque_nm_per_a = torque_per_amp,
      .emf_vs = (voltage - circuit_ohm * no_load_current) / no_load_speed,
  };
}

}  // namespace wheelwire::sim
