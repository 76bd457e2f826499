// What sensors forbid the wheels. reflex.cpp has the robot obey it.
#pragma once

#include "path.hpp"
#include "protocol.hpp"

namespace wheelwire {

/// Whether what the sensors forbid, as flags of `reflex`, keeps the robot from doing this: turning
/// a wheel towards a bumper, be it one alone, which would sweep the robot along the obstacle.
constexpr bool forbids(uint8_t reflexes, WheelPair wheels) {
  return ((reflexes & reflex::kNoForward) != 0 && (wheels.left > 0 || wheels.right > 0)) ||
         ((reflexes & reflex::kNoReverse) != 0 && (wheels.left < 0 || wheels.right < 0));
}

}  // namespace wheelwire
