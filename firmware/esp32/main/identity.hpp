#pragma once

#include "message_server.hpp"

namespace wheelwire {

/// Who this is, as DeviceHello tells it. Draws a new boot id: call once.
Identity make_identity(uint32_t capabilities);

}  // namespace wheelwire
