// The time until which a setpoint drives the robot, on the device's clock.
#pragma once

#include <stdint.h>

namespace wheelwire {

/// Deadline of a setpoint that arrives now: its expiry, but at most ttl_max from now.
constexpr uint64_t deadline_of(uint64_t expiry_us, uint64_t now_us, uint32_t ttl_max_us) {
  const uint64_t latest_us = now_us + ttl_max_us;
  return expiry_us < latest_us ? expiry_us : latest_us;
}

constexpr bool has_passed(uint64_t deadline_us, uint64_t now_us) { return deadline_us <= now_us; }

}  // namespace wheelwire
