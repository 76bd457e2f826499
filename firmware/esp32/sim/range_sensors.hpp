// The range sensors of a board, and the firmware's part that fires them.
#pragma once

#include <array>
#include <deque>

#include "range_finder.hpp"

namespace wheelwire::sim {

class SimulatedBoard;

/// What the variables of range sensors set.
struct RangeWorld {
  RangeWorld() { distance_m.fill(1.0); }

  std::array<double, kPlaces> distance_m{};  ///< Of what is ahead, by Place.
  bool absent = false;                       ///< Their plugs are off.
  bool hung = false;                         ///< Their echo outputs stay high.
};

/// Answers a trigger with the pulse of what is ahead at that time.
class SimulatedRangeSensor final : public EchoPins {
 public:
  SimulatedRangeSensor(const Peripheral& entry, const RangeWorld& world,
                       const SimulatedBoard& board)
      : entry_(entry), world_(world), board_(board) {}

  void trigger(uint32_t us) override;
  bool level() override;
  bool take(EchoPulse& out) override;

 private:
  bool answers() const;
  bool has_ended() const;

  Peripheral entry_;
  const RangeWorld& world_;
  const SimulatedBoard& board_;
  bool has_pulse_ = false;  // That was not taken.
  EchoPulse pulse_;
};

class RangeSensors {
 public:
  explicit RangeSensors(const SimulatedBoard& board) : board_(board) {}
  RangeSensors(const RangeSensors&) = delete;
  RangeSensors& operator=(const RangeSensors&) = delete;

  RangeWorld world;
  RangeFinder finder;  ///< The firmware's.

  /// The firmware starts with this list.
  void take_up(const PeripheralList& list);
  /// The firmware's task polls them.
  void poll();

 private:
  const SimulatedBoard& board_;
  std::deque<SimulatedRangeSensor> sensors_;
  uint64_t next_poll_us_ = 0;
};

}  // namespace wheelwire::sim
