// The failures that the self-test image has on demand.
#pragma once

#include "self_test_protocol.hpp"

namespace wheelwire {

/// Of the calling core. Returns only from kNone.
void fail_core(Failure failure);

}  // namespace wheelwire
