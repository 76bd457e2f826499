// A wheel's quadrature encoder: rotation in, levels of A and B out, with common faults.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "random.hpp"

namespace wheelwire::sim {

struct EncoderModel {
  bool dead = false;      ///< The levels are stuck.
  bool reversed = false;  ///< A and B swapped.
  int stuck = 0;          ///< Which level never changes: 1: A's, 2: B's.
  /// No edge comes for a twelfth of each turn; its edges all come together at its end.
  bool magnet_missing = false;
  double lost = 0.0;  ///< Fraction of the edges that are lost, at random.
  /// Each edge is off by up to this part of a tick, the same at every turn; below 0.5, so that the
  /// edges stay in order.
  double edge_error_ticks = 0.0;
};

class Quadrature {
 public:
  explicit Quadrature(uint64_t seed) : seed_(seed) {}

  EncoderModel model;

  bool a() const { return a_; }
  bool b() const { return b_; }
  /// True position [tick], forward positive.
  int64_t ticks() const { return static_cast<int64_t>(std::floor(position_)); }

  /// The position that the levels show: a sound counter counts this, even if edges are lost.
  int64_t shown_ticks() const { return shown_; }

  /// Turns the wheel; `sink(a, b)` is called at each change of a level.
  template <typename Sink>
  void turn(double angle_rad, int counts_per_revolution, Sink&& sink) {
    if (angle_rad == 0.0) return;
    position_ += angle_rad * counts_per_revolution / (2.0 * std::numbers::pi);
    while (position_ >= edge(interval_ + 1, counts_per_revolution)) enter(interval_ + 1, sink);
    while (position_ < edge(interval_, counts_per_revolution)) enter(interval_ - 1, sink);
  }

 private:
  /// Where the edge below interval `index` lies [tick].
  double edge(int64_t index, int counts_per_revolution) const {
    const double nominal = static_cast<double>(index);
    if (model.edge_error_ticks == 0.0 && !model.magnet_missing) return nominal;
    const int64_t turn = index % counts_per_revolution;
    const int64_t mark = turn < 0 ? turn + counts_per_revolution : turn;
    const int64_t gap = model.magnet_missing ? counts_per_revolution / kMagnets : 0;
    // Half a tick before the next edge, so that this one cannot be ahead by its error.
    if (mark < gap) return nominal + static_cast<double>(gap - mark) - 0.5;
    return nominal + model.edge_error_ticks * symmetric(mix(seed_ ^ static_cast<uint64_t>(mark)));
  }

  template <typename Sink>
  void enter(int64_t interval, Sink&& sink) {
    const int64_t step = interval - interval_;
    interval_ = interval;
    if (model.dead || loses()) return;
    shown_ += step;
    // Forward, A leads B by a quarter of a cycle: 00 10 11 01.
    const bool leading = (shown_ & 3) == 1 || (shown_ & 3) == 2;
    const bool trailing = (shown_ & 3) >= 2;
    if (model.stuck != kStuckA) a_ = model.reversed ? trailing : leading;
    if (model.stuck != kStuckB) b_ = model.reversed ? leading : trailing;
    sink(a_, b_);
  }

  bool loses() {
    if (model.lost == 0.0) return false;
    return (symmetric(mix(seed_ + ++edges_)) + 1.0) / 2.0 < model.lost;
  }

  static constexpr int kStuckA = 1;
  static constexpr int kStuckB = 2;
  static constexpr int kMagnets = 12;

  uint64_t seed_;
  uint64_t edges_ = 0;     ///< Edges so far, lost or not.
  int64_t shown_ = 0;      ///< The interval that the levels show.
  double position_ = 0.5;  // Between two edges, so that neither direction is a tick ahead.
  int64_t interval_ = 0;   ///< Between edge(interval_) and edge(interval_ + 1).
  bool a_ = false;
  bool b_ = false;
};

}  // namespace wheelwire::sim
