// The motors, encoders and contact that are wired to this chip.
#pragma once

#include "encoders.hpp"
#include "estop_contact.hpp"
#include "l298n.hpp"
#include "parameters.hpp"
#include "pwm_bridge.hpp"

namespace wheelwire {

struct WiredRobot {
  static constexpr uint32_t kCapabilities = capability::kEstopInput;

  /// Starts as much as possible. False: a peripheral did not start, and EN stays low.
  bool start(const Parameters& parameters);

  PwmTimer timer;
  PwmBridge left_bridge{kPins.left};
  PwmBridge right_bridge{kPins.right};
  L298n left_motor{left_bridge};
  L298n right_motor{right_bridge};
  Encoders encoders;
  EstopContact estop;
};

}  // namespace wheelwire
