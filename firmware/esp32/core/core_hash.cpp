#include "core_hash.hpp"

namespace wheelwire {

const uint32_t kCoreHash = WHEELWIRE_CORE_HASH;  // See ../core_hash.cmake.

}  // namespace wheelwire
