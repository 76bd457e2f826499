// All memory that two tasks share.
#pragma once

#include <atomic>

#include "hal.hpp"
#include "protocol.hpp"

namespace wheelwire {

/// The rule: each value has one writer and is whole in itself; no two of them are read together.
struct BoardState {
  std::atomic<SupervisorState> supervisor{SupervisorState::kBoot};  ///< By the control task.
  std::atomic<uint16_t> battery_mv{0};                              ///< By housekeeping.
};

/// What housekeeping measured last.
class LatestBattery final : public BatterySense {
 public:
  explicit LatestBattery(const BoardState& state) : state_(state) {}
  uint16_t millivolts() override { return state_.battery_mv.load(std::memory_order_relaxed); }

 private:
  const BoardState& state_;
};

}  // namespace wheelwire
