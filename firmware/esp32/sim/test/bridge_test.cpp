#include "bridge.hpp"

#include "check.hpp"

using wheelwire::sim::BridgeModel;
using wheelwire::sim::BridgePins;

namespace {

constexpr double kWinding = 5.0;  // [Ohm]

double current(const BridgePins& pins, double emf, const BridgeModel& model = {}) {
  return model.current(pins, emf, kWinding);
}

}  // namespace

TEST(bridge_truth_table_at_standstill) {
  CHECK(current({.in1 = true, .in2 = false, .enable = 1.0}, 0.0) > 0.5);
  CHECK(current({.in1 = false, .in2 = true, .enable = 1.0}, 0.0) < -0.5);
  CHECK(current({.in1 = false, .in2 = false, .enable = 1.0}, 0.0) == 0.0);
  CHECK(current({.in1 = true, .in2 = true, .enable = 1.0}, 0.0) == 0.0);
  CHECK(current({.in1 = true, .in2 = false, .enable = 0.0}, 0.0) == 0.0);
}

TEST(bridge_brakes_with_equal_inputs_and_coasts_with_enable_low) {
  for (const bool level : {false, true}) {
    CHECK(current({.in1 = level, .in2 = level, .enable = 1.0}, 4.0) < -0.2);
    CHECK(current({.in1 = level, .in2 = level, .enable = 1.0}, -4.0) > 0.2);
    CHECK(current({.in1 = level, .in2 = level, .enable = 0.0}, 4.0) == 0.0);
  }
}

TEST(bridge_does_not_brake_below_its_own_drop) {
  CHECK(current({.in1 = false, .in2 = false, .enable = 1.0}, 1.0) == 0.0);
}

TEST(bridge_drop_is_within_the_datasheet) {
  // A winding that lets `amperes` flow at standstill shows the drop in what it does not get.
  for (const double amperes : {1.0, 2.0}) {
    BridgeModel model;
    model.supply_v = 12.0;
    const double ohm = (model.supply_v - model.drop_v) / amperes - model.drop_ohm;
    const double flowing = model.current({.in1 = true, .enable = 1.0}, 0.0, ohm);
    CHECK(flowing > 0.999 * amperes && flowing < 1.001 * amperes);
    const double drop = model.supply_v - flowing * ohm;
    CHECK(amperes > 1.0 ? drop < 4.9 : drop > 1.8 && drop < 3.2);
  }
}

TEST(bridge_averages_or_chops_the_voltage) {
  const BridgePins half = {.in1 = true, .enable = 0.5};
  BridgeModel chopped;
  chopped.chopped = true;
  CHECK(current(half, 4.0) < 0.0);           // Faster than half the voltage: it brakes,
  CHECK(current(half, 4.0, chopped) > 0.0);  // unless the current dies out in between.
  CHECK(current(half, 7.0, chopped) == 0.0);
}

TEST(bridge_drives_only_with_unequal_inputs_and_enable) {
  CHECK((BridgePins{.in1 = true, .in2 = false, .enable = 0.25}.signed_duty() == 0.25));
  CHECK((BridgePins{.in1 = false, .in2 = true, .enable = 0.25}.signed_duty() == -0.25));
  CHECK((!BridgePins{.in1 = true, .in2 = true, .enable = 1.0}.drives()));
  CHECK((!BridgePins{.in1 = true, .in2 = false, .enable = 0.0}.drives()));
}
