// Which core this is: a hash of its sources, the same on every machine.
#pragma once

#include <stdint.h>

namespace wheelwire {

extern const uint32_t kCoreHash;

}  // namespace wheelwire
