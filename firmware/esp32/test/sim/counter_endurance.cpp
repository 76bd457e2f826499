// The chip's counter register with its limits, edge by edge, against a count that has none.
//
//   wheelwire-counter-endurance [EDGES]
//
// Forward, back, at random, and hovering around each limit; the firmware's total must be exact at
// each of its steps. Exits with 1 at the first tick that is lost or invented.

#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "counter.hpp"
#include "encoder.hpp"
#include "random.hpp"

using wheelwire::kCounterLimit;
using wheelwire::TickTotal;
using namespace wheelwire::sim;

namespace {

constexpr int64_t kDefaultEdges = 20'000'000;
constexpr int kLongestStep = kCounterLimit / 2;
constexpr int kHoverReach = 5;
/// Of each phase; a run has many of each.
constexpr int64_t kPhaseEdges = 400'000;

/// A wheel's encoder at the counter's inputs, and the totals on both sides.
class EnduranceRun {
 public:
  explicit EnduranceRun(uint64_t seed) : random_(seed) {}

  int64_t edges() const { return edges_; }
  int64_t updates() const { return updates_; }

  bool run(int64_t edges) {
    while (edges_ < edges) {
      const bool exact = turn([this] { return draw(kLongestStep); }) &&
                         turn([this] { return -draw(kLongestStep); }) &&
                         turn([this] { return sign() * draw(kLongestStep); }) &&
                         hover_about(kCounterLimit) && hover_about(-kCounterLimit);
      if (!exact) return false;
    }
    return true;
  }

 private:
  /// 1 to `limit`.
  int draw(int limit) {
    return 1 + static_cast<int>(random_.next() % static_cast<uint64_t>(limit));
  }
  int sign() { return random_.next() % 2 == 0 ? 1 : -1; }

  /// Turns by so many ticks, then lets the firmware read. Returns false when its total is wrong.
  bool step(int ticks) {
    const int direction = ticks < 0 ? -1 : 1;
    for (int edge = 0; edge != ticks; edge += direction) {
      position_ += direction;
      ++edges_;
      // Forward, A leads B by a quarter of a cycle: 00 10 11 01.
      const auto quarter = static_cast<unsigned>(position_ & 3);
      counter_.set_levels(quarter == 1 || quarter == 2, quarter >= 2);
    }
    ++updates_;
    const int32_t change = total_.update(counter_.value(), false);
    return change == ticks && total_.ticks() == static_cast<int32_t>(position_);
  }
  /// A phase of steps of so many ticks.
  bool turn(auto ticks) {
    for (const int64_t end = edges_ + kPhaseEdges; edges_ < end;)
      if (!step(ticks())) return false;
    return true;
  }

  /// Goes to the last count before `limit`, then back and forth across it.
  bool hover_about(int limit) {
    const int direction = limit < 0 ? -1 : 1;
    while (counter_.value() != limit - direction) {
      if (!step(direction)) return false;
    }
    int away = 0;  // From the limit [tick]; kept small, or it would not hover.
    return turn([&] {
      const int move = away > kHoverReach ? -1 : away < -kHoverReach ? 1 : sign();
      const int ticks = move * draw(3);
      away += ticks;
      return ticks;
    });
  }

  Random random_;
  PulseCounter counter_{false, false};
  TickTotal total_;
  int64_t position_ = 0;
  int64_t edges_ = 0;
  int64_t updates_ = 0;
};

}  // namespace

int main(int argc, char** argv) {
  const int64_t edges = argc > 1 ? static_cast<int64_t>(std::atof(argv[1])) : kDefaultEdges;
  EnduranceRun endurance(1);
  const bool exact = endurance.run(edges);
  std::printf("%lld edges, %lld reads, %s\n", static_cast<long long>(endurance.edges()),
              static_cast<long long>(endurance.updates()),
              exact ? "every total exact" : "a total is wrong");
  return exact ? 0 : 1;
}
