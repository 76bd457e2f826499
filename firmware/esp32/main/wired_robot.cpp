#include "wired_robot.hpp"

namespace wheelwire {

bool WiredRobot::start(const Parameters& parameters) {
  const auto whole = [&](ParameterId id) { return static_cast<uint32_t>(parameters.get(id)); };
  const bool estop_started = estop.start();
  const bool encoders_started = encoders.start(whole(ParameterId::kGlitchFilterNs));
  const bool motors_started = timer.create(whole(ParameterId::kPwmFrequencyHz)) &&
                              left_bridge.start(timer) && right_bridge.start(timer) && timer.run();
  return estop_started && encoders_started && motors_started;
}

}  // namespace wheelwire
