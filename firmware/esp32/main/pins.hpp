// Which pins the chip may drive at all: those of a board that somebody confirmed. All others float.
#pragma once

#include "configuration.hpp"

namespace wheelwire {

/// The first act after a reset: whatever was driven before floats, except what the bootloader holds
/// low. False: the pins cannot be set up.
bool float_pins();

/// Call when the board is known: its pins that hold the motors off are low, all others float, also
/// those of a previous board. While nobody has confirmed the board all float: where they lead is a
/// guess.
bool take_pins(ConfigurationState state, const BoardDescription& board);

}  // namespace wheelwire
