// The chip may drive only the pins of a confirmed board. All others float.
#pragma once

#include "configuration.hpp"

namespace wheelwire {

/// The first step after a reset: all pins float, except those that the bootloader holds low. False:
/// the pins cannot be set up.
bool float_pins();

/// Call when the board is known. Its pins that hold the motors off become low; all others float,
/// also those of a previous board. On an unconfirmed board all float, because their wiring is a
/// guess.
bool take_pins(ConfigurationState state, const BoardDescription& board);

}  // namespace wheelwire
