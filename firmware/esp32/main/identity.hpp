#pragma once

#include "message_server.hpp"

namespace wheelwire {

/// What DeviceHello reports. Draws a new boot id: call once.
Identity make_identity(uint32_t capabilities);

}  // namespace wheelwire
