#include "plant.hpp"

#include <cmath>

#include "check.hpp"

using namespace wheelwire::sim;

namespace {

constexpr BridgeState kForward = {.on = Winding::kForward, .duty = 1.0};
constexpr BridgeState kBackward = {.on = Winding::kReverse, .duty = 0.5};

void run(Plant& plant, double seconds, const std::array<BridgeState, 2>& pins) {
  const int steps = static_cast<int>(std::lround(seconds / kMaxPhysicsStep));
  for (int i = 0; i < steps; ++i) plant.step(kMaxPhysicsStep, pins);
}

}  // namespace

TEST(supply_settles_at_any_resistance) {
  for (const double ohm : {0.01, 0.5, 3.0, 20.0}) {
    for (const bool chopped : {false, true}) {
      PlantModel model;
      model.supply_ohm = ohm;
      model.bridge.chopped = chopped;
      for (WheelModel& wheel : model.wheels) wheel.blocked = true;
      model.wheels[kRight].motor_reversed = true;
      Plant plant(model);
      run(plant, 0.1, {kForward, kBackward});
      const double before = plant.supply_v();
      plant.step(kMaxPhysicsStep, {kForward, kBackward});
      CHECK(std::abs(plant.supply_v() - before) < 1e-9);
      const double drawn =
          plant.current_a(kLeft) + plant.current_a(kRight) * (chopped ? 1.0 : kBackward.duty);
      CHECK(std::abs(plant.supply_v() - (7.4 - ohm * drawn)) < 1e-6);
      CHECK(plant.supply_v() > 0.0 && plant.sag_v() > 0.0);
      run(plant, 0.1, {});
      CHECK(plant.sag_v() < 1e-6);
    }
  }
}

TEST(scales_of_one_wheel_leave_the_other_alone) {
  Plant plain;
  PlantModel model;
  model.wheels[kLeft] = {.torque_scale = 0.5,
                         .winding_scale = 2.0,
                         .coulomb_scale = 2.0,
                         .static_scale = 2.0,
                         .viscous_scale = 2.0,
                         .radius_scale = 1.2};
  Plant scaled(model);
  run(plain, 0.5, {kForward, kForward});
  run(scaled, 0.5, {kForward, kForward});
  CHECK(plain.wheel_rad(kRight) == scaled.wheel_rad(kRight));
  CHECK(plain.current_a(kRight) == scaled.current_a(kRight));
  CHECK(scaled.wheel_rad(kLeft) < 0.5 * plain.wheel_rad(kLeft));
}

TEST(momentum_is_kept_when_the_gears_meet) {
  PlantModel model;
  model.wheels[kLeft].backlash_rad = 0.2;
  Plant plant(model);
  double before = 0.0;
  while (plant.wheel_rad(kLeft) == 0.0) {
    before = plant.turned_rad(kLeft) / kMaxPhysicsStep;
    plant.step(kMaxPhysicsStep, {kForward, {}});
  }
  const double inertia = model.mass_kg / 2.0 * 0.033 * 0.033 + model.rotor_inertia_kgm2;
  const double after = plant.speed_mps(kLeft) / 0.033;
  CHECK(std::abs(after * inertia / (before * model.rotor_inertia_kgm2) - 1.0) < 0.1);
}

TEST(a_model_that_the_step_cannot_follow_is_refused) {
  PlantModel model;
  CHECK(is_physical(model));
  model.rotor_inertia_kgm2 = 0.0;
  CHECK(is_physical(model));
  model.wheels[kRight].backlash_rad = 0.1;
  CHECK(!is_physical(model));
  model.wheels[kRight].backlash_rad = 0.0;
  model.wheels_free = true;
  CHECK(!is_physical(model));
}

TEST(hands_push_a_robot_with_its_wheels_and_let_go_once_it_stands) {
  PlantModel model;
  model.wheels[kLeft].backlash_rad = 0.2;
  Plant plant(model);
  plant.push = {.forward_mps = 0.5, .turn_radps = 1.0};
  run(plant, 1.0, {kForward, kBackward});
  CHECK(std::abs(plant.forward_mps() - 0.5) < 1e-6);
  CHECK(std::abs(plant.yaw_rate_radps() - 1.0) < 1e-6);
  CHECK(std::abs(plant.speed_mps(kLeft) - 0.4) < 1e-6);
  CHECK(std::abs(plant.speed_mps(kRight) - 0.6) < 1e-6);
  // It took 0.25 s and 0.1 s to the full speeds.
  CHECK(std::abs(plant.distance_m() - (0.5 - 0.5 * 0.25 / 2)) < 1e-3);
  CHECK(std::abs(plant.pose().heading_rad - (1.0 - 1.0 * 0.1 / 2)) < 1e-3);
  const double travel = (plant.wheel_rad(kLeft) + plant.wheel_rad(kRight)) / 2 * 0.033;
  CHECK(std::abs(travel - plant.distance_m()) < 1e-6);
  plant.push = {};
  run(plant, 0.3, {});
  CHECK(plant.stands_still() && plant.forward_mps() == 0.0);
  run(plant, 0.3, {kForward, kForward});
  CHECK(plant.forward_mps() > 0.05);
}

TEST(a_raised_robot_is_carried_and_a_blocked_wheel_slides) {
  for (const bool is_raised : {true, false}) {
    PlantModel model;
    model.wheels_free = is_raised;
    model.wheels[kLeft].blocked = true;
    Plant plant(model);
    plant.push = {.turn_radps = -2.0};
    run(plant, 1.0, {});
    CHECK(std::abs(plant.pose().heading_rad - (-2.0 + 0.2)) < 1e-3);
    CHECK(plant.distance_m() < 1e-9);
    CHECK(plant.wheel_rad(kLeft) == 0.0);
    CHECK((plant.wheel_rad(kRight) == 0.0) == is_raised);
  }
}

TEST(the_motors_current_empties_a_battery) {
  PlantModel model;
  model.battery_ah = 1e-3;
  model.battery_fall_v = 2.0;
  Plant plant(model);
  run(plant, 1.0, {});
  CHECK(plant.used_ah == 0.0 && plant.supply_v() == 7.4);
  double drawn_as = 0.0;
  for (int i = 0; i < 10000; ++i) {
    drawn_as += plant.drawn_a({kForward, kBackward}) * kMaxPhysicsStep;
    plant.step(kMaxPhysicsStep, {kForward, kBackward});
  }
  CHECK(std::abs(plant.used_ah - drawn_as / 3600.0) < 1e-12);
  CHECK(plant.used_ah > 0.0 && plant.used_ah < model.battery_ah);
  const double share = plant.used_ah / model.battery_ah;
  CHECK(std::abs(plant.supply_v() - (7.4 - 2.0 * share)) < 1e-9);
  CHECK(std::abs(plant.sag_v() - 2.0 * share) < 1e-9);
  // Another variable is set: it is as empty as before.
  const double before = plant.supply_v();
  model.mass_kg = 1.0;
  plant.configure(model);
  CHECK(plant.supply_v() == before);
  run(plant, 60.0, {kForward, kForward});
  CHECK(std::abs(plant.supply_v() - 5.4) < 1e-9);
  plant.used_ah = 0.0;
  run(plant, kMaxPhysicsStep, {});
  CHECK(plant.supply_v() == 7.4);
}
