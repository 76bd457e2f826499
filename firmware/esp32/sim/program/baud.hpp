// The speed of a terminal as a number, standard or not.
#pragma once

#include <cstdint>

namespace wheelwire::sim {

/// The output speed of `fd` [baud]; 0 if it is not a terminal or has hung up.
uint32_t baud_of(int fd);

}  // namespace wheelwire::sim
