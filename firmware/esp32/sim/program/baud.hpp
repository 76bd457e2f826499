// The speed of a terminal as a number, standard or not.
#pragma once

#include <cstdint>

namespace wheelwire::sim {

/// The output speed that `fd` is set to [baud]; 0 when it is no terminal or hung up.
uint32_t baud_of(int fd);

}  // namespace wheelwire::sim
