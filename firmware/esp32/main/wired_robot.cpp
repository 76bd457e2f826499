#include "wired_robot.hpp"

namespace wheelwire {

bool WiredRobot::start(const Parameters& parameters) {
  const auto whole = [&](ParameterId id) { return static_cast<uint32_t>(parameters.get(id)); };
  const bool estop_started = estop.start(board);
  const bool encoders_started = encoders.start(board, whole(ParameterId::kGlitchFilterNs));
  const bool motors_started = timer.create(whole(ParameterId::kPwmFrequencyHz)) &&
                              left_pins.start(timer, board, 0) &&
                              right_pins.start(timer, board, 1) && timer.run();
  return estop_started && encoders_started && motors_started;
}

}  // namespace wheelwire
