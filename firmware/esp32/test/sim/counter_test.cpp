#include "counter.hpp"

#include <numbers>

#include "check.hpp"
#include "quadrature.hpp"
#include "random.hpp"

using wheelwire::kCounterLimit;
using wheelwire::sim::PulseCounter;
using wheelwire::sim::Quadrature;
using wheelwire::sim::Random;
using wheelwire::sim::symmetric;

namespace {

constexpr int kCountsPerRevolution = 360;

/// An encoder wired to a counter.
struct Wheel {
  Quadrature encoder{7};
  PulseCounter counter{false, false};

  void turn_ticks(double ticks) {
    encoder.turn(ticks * 2.0 * std::numbers::pi / kCountsPerRevolution, kCountsPerRevolution,
                 [this](bool a, bool b) { counter.set_levels(a, b); });
  }
};

/// What firmware makes of two raw readings: right while the step is below half the modulus.
int modular_difference(int later, int earlier) {
  const int difference = (later - earlier) % kCounterLimit;
  if (difference > kCounterLimit / 2) return difference - kCounterLimit;
  if (difference < -(kCounterLimit / 2)) return difference + kCounterLimit;
  return difference;
}

}  // namespace

TEST(counter_counts_each_edge_up_when_a_leads_b) {
  PulseCounter counter(false, false);
  const bool levels[4][2] = {{true, false}, {true, true}, {false, true}, {false, false}};
  for (int edge = 0; edge < 8; ++edge) {
    counter.set_levels(levels[edge % 4][0], levels[edge % 4][1]);
    CHECK(counter.value() == edge + 1);
  }
}

TEST(counter_counts_each_edge_down_when_b_leads_a) {
  PulseCounter counter(false, false);
  const bool levels[4][2] = {{false, true}, {true, true}, {true, false}, {false, false}};
  for (int edge = 0; edge < 8; ++edge) {
    counter.set_levels(levels[edge % 4][0], levels[edge % 4][1]);
    CHECK(counter.value() == -edge - 1);
  }
}

TEST(counter_returns_to_zero_at_both_limits) {
  Wheel wheel;
  wheel.turn_ticks(kCounterLimit - 1);
  CHECK(wheel.counter.value() == kCounterLimit - 1);
  wheel.turn_ticks(1);
  CHECK(wheel.counter.value() == 0);
  wheel.turn_ticks(-1);
  CHECK(wheel.counter.value() == -1);
  wheel.turn_ticks(-kCounterLimit + 2);
  CHECK(wheel.counter.value() == -kCounterLimit + 1);
  wheel.turn_ticks(-1);
  CHECK(wheel.counter.value() == 0);
}

TEST(counter_difference_is_exact_over_long_and_hovering_travel) {
  Wheel wheel;
  Random random(11);
  long long travelled = 0;
  int before = 0;
  for (int step = 0; step < 20'000; ++step) {
    // A third of the steps hover about a limit, the others run, both ways.
    const double reach = step % 3 == 0 ? 3.0 : 16'000.0;
    wheel.turn_ticks(reach * symmetric(random.next()));
    travelled += modular_difference(wheel.counter.value(), before);
    before = wheel.counter.value();
    if (travelled != wheel.encoder.ticks()) break;
  }
  CHECK(travelled == wheel.encoder.ticks());
}

TEST(quadrature_edge_errors_move_edges_and_lose_none) {
  Wheel ideal;
  Wheel uneven;
  uneven.encoder.model.edge_error_ticks = 0.45;
  int differing = 0;
  for (int step = 0; step < 10'000; ++step) {
    ideal.turn_ticks(0.13);
    uneven.turn_ticks(0.13);
    const int error = uneven.counter.value() - ideal.counter.value();
    CHECK(error >= -1 && error <= 1);
    differing += error != 0;
  }
  CHECK(differing > 1000);
}

TEST(quadrature_faults) {
  Wheel dead;
  dead.encoder.model.dead = true;
  dead.turn_ticks(100);
  CHECK(dead.counter.value() == 0 && dead.encoder.ticks() == 100);
  Wheel reversed;
  reversed.encoder.model.reversed = true;
  reversed.turn_ticks(100);
  CHECK(reversed.counter.value() == -100);
}
