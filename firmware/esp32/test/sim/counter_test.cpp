#include "counter.hpp"

#include <numbers>

#include "check.hpp"
#include "quadrature.hpp"

using namespace wheelwire::sim;

namespace {

constexpr int kCountsPerRevolution = 360;

/// An encoder wired to a counter.
struct EncoderAtCounter {
  Quadrature encoder{7};
  PulseCounter counter{false, false};

  void turn_ticks(double ticks) {
    encoder.turn(ticks * 2.0 * std::numbers::pi / kCountsPerRevolution, kCountsPerRevolution,
                 [this](bool a, bool b) { counter.set_levels(a, b); });
  }
};

}  // namespace

TEST(counter_counts_each_edge_by_the_input_that_leads) {
  const bool levels[4][2] = {{true, false}, {true, true}, {false, true}, {false, false}};
  for (const bool a_leads : {true, false}) {
    PulseCounter counter(false, false);
    for (int edge = 0; edge < 8; ++edge) {
      const auto& [leading, following] = levels[edge % 4];
      counter.set_levels(a_leads ? leading : following, a_leads ? following : leading);
      CHECK(counter.value() == (a_leads ? edge + 1 : -edge - 1));
    }
  }
}

TEST(quadrature_edge_errors_move_edges_and_lose_none) {
  EncoderAtCounter ideal;
  EncoderAtCounter uneven;
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
