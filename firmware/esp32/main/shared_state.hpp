// All state that two tasks share.
#pragma once

#include <atomic>

#include "hal.hpp"
#include "protocol.hpp"

namespace wheelwire {

/// Each value has a single writer, named below, and stands alone: no two have to be consistent.
struct SharedState {
  std::atomic<SupervisorState> supervisor{SupervisorState::kBoot};  ///< By the control task.
  std::atomic<uint16_t> battery_mv{0};                              ///< By housekeeping.
};

/// The latest measurement of housekeeping.
class LatestBattery final : public BatterySense {
 public:
  explicit LatestBattery(const SharedState& state) : state_(state) {}
  uint16_t millivolts() override { return state_.battery_mv.load(std::memory_order_relaxed); }

 private:
  const SharedState& state_;
};

}  // namespace wheelwire
