// Until when a setpoint drives the robot, in the device's clock.
#pragma once

#include <stdint.h>

namespace wheelwire {

/// Of a setpoint that arrives now: it lives until its expiry, and for ttl_max at most.
constexpr uint64_t deadline_of(uint64_t expiry_us, uint64_t now_us, uint32_t ttl_max_us) {
  const uint64_t latest_us = now_us + ttl_max_us;
  return expiry_us < latest_us ? expiry_us : latest_us;
}

constexpr bool has_passed(uint64_t deadline_us, uint64_t now_us) { return deadline_us <= now_us; }

}  // namespace wheelwire
