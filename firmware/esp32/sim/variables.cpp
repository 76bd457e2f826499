#include "variables.hpp"

#include <cmath>
#include <numbers>
#include <type_traits>
#include <unordered_map>

#include "shipped_boards.hpp"

namespace wheelwire::sim {

namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

/// The description of a variable, before it is bound to what it reads and sets.
Variable real(std::string name, const char* unit, double minimum, double maximum, std::string doc) {
  return {.name = std::move(name),
          .unit = unit,
          .doc = std::move(doc),
          .minimum = minimum,
          .maximum = maximum,
          .whole = false,
          .get = nullptr,
          .set = nullptr};
}

Variable whole(std::string name, const char* unit, double minimum, double maximum,
               std::string doc) {
  Variable variable = real(std::move(name), unit, minimum, maximum, std::move(doc));
  variable.whole = true;
  return variable;
}

Variable toggle(std::string name, std::string doc) {
  return whole(std::move(name), "0 or 1", 0, 1, std::move(doc));
}

/// Relative to the model of both wheels.
Variable scale(std::string name, double minimum, double maximum, std::string doc) {
  return real(std::move(name), "", minimum, maximum, std::move(doc));
}

Variable reading(std::string name, const char* unit, std::string doc,
                 double (*get)(const Simulator&)) {
  Variable variable = real(std::move(name), unit, 0, 0, std::move(doc));
  variable.get = get;
  return variable;
}

/// Converts to any field type without a warning; the table's bounds keep it exact.
template <typename Field>
void assign(Field& field, double value) {
  if constexpr (std::is_same_v<Field, bool>) {
    field = value != 0.0;
  } else {
    field = static_cast<Field>(value);
  }
}

/// Binds a variable to the field that `kField(simulator)` refers to.
template <auto kField>
Variable with_field(Variable variable) {
  variable.get = [](const Simulator& simulator) { return static_cast<double>(kField(simulator)); };
  variable.set = [](Simulator& simulator, double value) {
    assign(kField(simulator), value);
    return true;
  };
  return variable;
}

/// Binds a variable to the field of the plant's model that `kField(model)` refers to.
template <auto kField>
Variable with_model(Variable variable) {
  variable.get = [](const Simulator& simulator) {
    return static_cast<double>(kField(simulator.board.plant.model()));
  };
  variable.set = [](Simulator& simulator, double value) {
    PlantModel model = simulator.board.plant.model();
    assign(kField(model), value);
    if (!is_physical(model)) return false;
    simulator.board.plant.configure(model);
    return true;
  };
  return variable;
}

void add_world(std::vector<Variable>& table) {
  table.insert(table.end(),
               {
                   with_model<[](auto& m) -> auto& { return m.bridge.supply_v; }>(
                       real("supply_v", "V", 0, 60, "Motor supply, before the bridge.")),
                   with_model<[](auto& m) -> auto& { return m.supply_ohm; }>(
                       real("supply_ohm", "Ohm", 0, 20,
                            "Of battery and leads: the supply sags, and with it what the battery "
                            "input senses.")),
                   with_model<[](auto& m) -> auto& { return m.battery_ah; }>(
                       real("battery.capacity_ah", "A h", 0, 1000,
                            "Of the battery, which the motors' current empties; 0: it stays as it "
                            "is.")),
                   with_model<[](auto& m) -> auto& { return m.battery_fall_v; }>(
                       real("battery.fall_v", "V", 0, 60,
                            "By which its voltage falls, evenly, until it is empty: the motor "
                            "supply, and what the battery input senses.")),
                   with_field<[](auto& s) -> auto& { return s.board.plant.used_ah(); }>(
                       real("battery.used_ah", "A h", 0, 1000,
                            "What the motors have drawn of its capacity; setting it to 0 charges "
                            "the battery.")),
                   with_field<[](auto& s) -> auto& { return s.board.brownout_v; }>(
                       real("brownout_v", "V", 0, 60,
                            "A supply below this resets the chip, and holds it in reset.")),
                   with_model<[](auto& m) -> auto& { return m.bridge.drop_v; }>(
                       real("bridge.drop_v", "V", 0, 5, "The L298N's drop at no current.")),
                   with_model<[](auto& m) -> auto& { return m.bridge.drop_ohm; }>(real(
                       "bridge.drop_ohm", "V/A", 0, 5, "How its drop grows with the current.")),
                   with_model<[](auto& m) -> auto& { return m.bridge.chopped; }>(
                       toggle("bridge.chopped",
                              "The winding's current decays in the PWM's off time, as at a low PWM "
                              "frequency.")),
                   with_model<[](auto& m) -> auto& { return m.motor.supply_v; }>(real(
                       "motor.supply_v", "V", 1, 60, "Supply at which the motor's ratings hold.")),
                   with_model<[](auto& m) -> auto& { return m.motor.at_terminals; }>(
                       toggle("motor.at_terminals",
                              "The ratings are the motor's alone, as in a data sheet, not those "
                              "behind the bridge.")),
                   with_model<[](auto& m) -> auto& { return m.motor.no_load_rpm; }>(
                       real("motor.no_load_rpm", "1/min", 10, 2000, "Of the wheel.")),
                   with_model<[](auto& m) -> auto& { return m.motor.stall_current_a; }>(
                       real("motor.stall_current_a", "A", 0.1, 50, "At motor.supply_v.")),
                   with_model<[](auto& m) -> auto& { return m.motor.stall_torque_nm; }>(
                       real("motor.stall_torque_nm", "N m", 0.005, 10, "At the wheel.")),
                   with_model<[](auto& m) -> auto& { return m.friction.coulomb_nm; }>(real(
                       "friction.coulomb_nm", "N m", 0, 1, "Of a turning wheel with its gearbox.")),
                   with_model<[](auto& m) -> auto& { return m.friction.static_nm; }>(
                       real("friction.static_nm", "N m", 0, 1, "To start a wheel from rest.")),
                   with_model<[](auto& m) -> auto& { return m.friction.viscous_nms; }>(
                       real("friction.viscous_nms", "N m s/rad", 0, 0.1, "Grows with the speed.")),
                   with_model<[](auto& m) -> auto& { return m.mass_kg; }>(
                       real("mass_kg", "kg", 0.05, 100, "Of the robot.")),
                   with_model<[](auto& m) -> auto& { return m.rotor_inertia_kgm2; }>(
                       real("rotor_inertia_kgm2", "kg m^2", 0, 1,
                            "Of one motor with its wheel, seen at the wheel.")),
                   with_model<[](auto& m) -> auto& { return m.wheel_radius_m; }>(
                       real("wheel_radius_m", "m", 0.005, 1, "Of both wheels.")),
                   with_model<[](auto& m) -> auto& { return m.wheel_separation_m; }>(
                       real("wheel_separation_m", "m", 0.02, 5, "Between the wheels' middles.")),
                   with_model<[](auto& m) -> auto& { return m.slope_rad; }>(
                       real("slope_rad", "rad", -1, 1, "The plane rises along +x.")),
                   with_model<[](auto& m) -> auto& { return m.slip; }>(
                       real("slip", "", 0, 1,
                            "The share of the travel that is lost when a wheel pushes with its "
                            "share of the robot's weight; less in proportion below.")),
                   with_model<[](auto& m) -> auto& { return m.wheels_free; }>(
                       toggle("wheels_free",
                              "The robot is raised: its wheels turn with their own inertia and "
                              "friction, and it stays where it is.")),
                   with_model<[](auto& m) -> auto& { return m.motors_swapped; }>(toggle(
                       "motors_swapped",
                       "The left bridge drives the right motor, and the right one the left.")),
                   with_field<[](auto& s) -> auto& { return s.board.wiring.swapped; }>(toggle(
                       "encoders_swapped",
                       "The left counter has the right encoder, and the right one the left.")),
                   with_field<[](auto& s) -> auto& { return s.board.wiring.both_on; }>(whole(
                       "encoders_same", "", 0, 2,
                       "Both counters have the same encoder: 1 the left one, 2 the right one; "
                       "0: each has its own.")),
                   with_field<[](auto& s) -> auto& { return s.board.wiring.mixed; }>(toggle(
                       "channels_mixed", "Each counter has A of one encoder and B of the other.")),
               });
}

template <Side kSide>
Variable by_hand(const std::string& side) {
  Variable variable =
      real(side + ".hand_turns", "turn", -1000, 1000,
           "Turned by hand, forward positive, once a second, and then let go; reads "
           "as what is left.");
  variable.get = [](const Simulator& s) { return s.board.plant.hand_rad(kSide) / kTurn; };
  variable.set = [](Simulator& s, double turns) {
    s.board.plant.turn_by_hand(kSide, turns * kTurn);
    return true;
  };
  return variable;
}

void add_hands(std::vector<Variable>& table) {
  table.insert(
      table.end(),
      {
          with_field<[](auto& s) -> auto& { return s.board.plant.push().forward_mps; }>(
              real("push.forward_mps", "m/s", -5, 5,
                   "Hands push the robot at this speed, with its wheels if it is on the floor, "
                   "whatever the motors do; 0 in both: they let go once it stands.")),
          with_field<[](auto& s) -> auto& { return s.board.plant.push().turn_radps; }>(real(
              "push.turn_radps", "rad/s", -10, 10, "The same, turned counter-clockwise positive.")),
          with_field<[](auto& s) -> auto& { return s.board.plant.held().roll_rad; }>(
              real("tilt.roll_rad", "rad", -kTurn / 2, kTurn / 2,
                   "Hands tilt the robot to this, one radian in a second, the right side down "
                   "positive. Only the IMU notices.")),
          with_field<[](auto& s) -> auto& { return s.board.plant.held().pitch_rad; }>(real(
              "tilt.pitch_rad", "rad", -kTurn / 2, kTurn / 2, "The same, the nose down positive.")),
      });
}

template <Side kSide>
void add_wheel(std::vector<Variable>& table, const std::string& side) {
  table.insert(
      table.end(),
      {
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].motor_scale; }>(
              scale(side + ".motor_scale", 0.2, 3, "No-load speed, relative to the rating.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].torque_scale; }>(
              scale(side + ".torque_scale", 0.05, 3, "Torque per ampere, relative to the rating.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].winding_scale; }>(
              scale(side + ".winding_scale", 0.2, 20,
                    "The winding's resistance, relative to the rating.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].coulomb_scale; }>(
              scale(side + ".coulomb_scale", 0, 20, "Relative to friction.coulomb_nm.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].static_scale; }>(
              scale(side + ".static_scale", 0, 20, "Relative to friction.static_nm.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].viscous_scale; }>(
              scale(side + ".viscous_scale", 0, 20, "Relative to friction.viscous_nms.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].radius_scale; }>(
              scale(side + ".radius_scale", 0.5, 2, "Relative to wheel_radius_m.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].backlash_rad; }>(
              real(side + ".backlash_rad", "rad", 0, 1,
                   "Play of the gearbox, at the wheel; the encoder is on the motor's side.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].motor_reversed; }>(
              toggle(side + ".motor_reversed", "The motor's wires are swapped.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].motor_open; }>(
              toggle(side + ".motor_open", "A wire of the motor is off: no current flows.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].load_nm; }>(
              real(side + ".load_nm", "N m", -10, 10, "Acts against forward motion.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].slip; }>(
              real(side + ".slip", "", 0, 1,
                   "The share of the wheel's travel that does not move the robot, whatever it "
                   "pushes, as on ice.")),
          with_model<[](auto& m) -> auto& { return m.wheels[kSide].blocked; }>(
              toggle(side + ".blocked", "The wheel is held fast.")),
          with_field<[](auto& s) -> auto& { return s.board.encoders[kSide].model.dead; }>(
              toggle(side + ".encoder_dead", "A and B are stuck.")),
          with_field<[](auto& s) -> auto& { return s.board.encoders[kSide].model.reversed; }>(
              toggle(side + ".encoder_reversed", "A and B are swapped.")),
          with_field<[](auto& s) -> auto& { return s.board.encoders[kSide].model.stuck; }>(
              whole(side + ".stuck_channel", "", 0, 2,
                    "The channel whose level never changes: 1 for A, 2 for B; 0: neither.")),
          with_field<[](auto& s) -> auto& { return s.board.encoders[kSide].model.stuck; }>(
              whole(side + ".encoder_stuck", "", 0, 2, "Another name of stuck_channel.")),
          with_field<[](auto& s) -> auto& { return s.board.encoders[kSide].model.magnet_missing; }>(
              toggle(
                  side + ".magnet_missing",
                  "No edge comes for a twelfth of each turn; those of that part come together at "
                  "its end.")),
          with_field<[](auto& s) -> auto& { return s.board.encoders[kSide].model.lost; }>(
              real(side + ".encoder_lost", "", 0, 1, "The share of the edges that is lost.")),
          with_field<[](auto& s) -> auto& {
            return s.board.encoders[kSide].model.edge_error_ticks;
          }>(real(side + ".encoder_error_ticks", "tick", 0, 0.45,
                  "Each edge is off by up to this, the same at every turn.")),
          by_hand<kSide>(side),
          reading(side + ".duty", "", "On the side's bridge, forward positive; 0 when not driving.",
                  [](const Simulator& s) { return s.board.bridges()[kSide].signed_duty(); }),
          reading(side + ".shorted", "", "The share of the time in which the winding is shorted.",
                  [](const Simulator& s) { return s.board.bridges()[kSide].shorted(); }),
          reading(side + ".current_a", "A", "Through the winding.",
                  [](const Simulator& s) { return s.board.plant.current_a(kSide); }),
          reading("true." + side + "_turns", "turn", "By the wheel, behind its gearbox's play.",
                  [](const Simulator& s) { return s.board.plant.wheel_rad(kSide) / kTurn; }),
          reading("true." + side + "_slip", "", "The share of the travel that is lost.",
                  [](const Simulator& s) { return s.board.plant.slip(kSide); }),
          reading("true." + side + "_mps", "m/s", "Speed at the rim.",
                  [](const Simulator& s) { return s.board.plant.speed_mps(kSide); }),
          reading("true." + side + "_ticks", "tick",
                  "What an ideal encoder at its place would have counted.",
                  [](const Simulator&
                         s) { return static_cast<double>(s.board.encoders[kSide].ticks()); }),
      });
}

Variable wired_board() {
  std::string doc =
      "The board that is wired, from now on; the firmware drives the pins of its active one: ";
  for (size_t i = 0; i < kShippedBoardsOfEsp32; ++i)
    doc += std::to_string(i) + " " + kShippedBoards[i].name + ", ";
  Variable variable =
      whole("wired_board", "", -1, kShippedBoardsOfEsp32 - 1, doc + "-1: the active one.");
  variable.get = [](const Simulator& s) {
    if (s.board.is_wired_as_active()) return -1.0;
    size_t i = 0;
    while (i < kShippedBoardsOfEsp32 && kShippedBoards[i].board != s.board.wired()) ++i;
    return static_cast<double>(i);
  };
  variable.set = [](Simulator& s, double value) {
    if (value < 0.0) {
      s.board.wire_as_active();
    } else {
      s.board.wire(kShippedBoards[static_cast<size_t>(value)].board);
    }
    return true;
  };
  return variable;
}

Variable floating_level() {
  Variable variable =
      toggle("floating_level",
             "What a power stage's input reads while nothing drives and nothing holds it: an "
             "L298N's float high, others either way.");
  variable.get = [](const Simulator& s) { return s.board.floating_level() ? 1.0 : 0.0; };
  variable.set = [](Simulator& s, double value) {
    s.board.set_floating_level(value != 0.0);
    return true;
  };
  return variable;
}

template <Place kPlace>
Variable bumper(std::string name) {
  return with_field<[](auto& s) -> auto& {
    return s.board.sensors.bumpers[static_cast<size_t>(kPlace)];
  }>(toggle(std::move(name), "It is pressed, or its wire is broken. Needs a bumper there."));
}

template <Place kPlace>
Variable cliff(std::string name) {
  return with_field<[](auto& s) -> auto& {
    return s.board.sensors.cliffs[static_cast<size_t>(kPlace)];
  }>(toggle(std::move(name), "No floor below it. Needs a cliff sensor there."));
}

template <Place kPlace>
Variable range(std::string name) {
  return with_field<[](auto& s) -> auto& {
    return s.board.sensors.ranges.world.distance_m[static_cast<size_t>(kPlace)];
  }>(real(std::move(name), "m", 0, 20,
          "How far away something is there; beyond 4.5 m nothing is heard of it. Needs a range "
          "sensor there."));
}

template <size_t kIndex>
Variable analog(std::string name) {
  return with_field<[](auto& s) -> auto& { return s.board.sensors.analog_v[kIndex]; }>(
      real(std::move(name), "V", 0, 60,
           "Before the divider of the analogue input with this number. Needs one."));
}

void add_ranges(std::vector<Variable>& table) {
  table.insert(
      table.end(),
      {
          range<Place::kFront>("range.front_m"),
          range<Place::kFrontLeft>("range.front_left_m"),
          range<Place::kFrontRight>("range.front_right_m"),
          range<Place::kRear>("range.rear_m"),
          range<Place::kRearLeft>("range.rear_left_m"),
          range<Place::kRearRight>("range.rear_right_m"),
          range<Place::kLeft>("range.left_m"),
          range<Place::kRight>("range.right_m"),
          with_field<[](auto& s) -> auto& { return s.board.sensors.ranges.world.absent; }>(
              toggle("range.absent", "The plugs of the range sensors are off.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.ranges.world.hung; }>(
              toggle("range.hung", "The echo outputs of the range sensors stay high.")),
          analog<0>("analog.1_v"),
          analog<1>("analog.2_v"),
          analog<2>("analog.3_v"),
          analog<3>("analog.4_v"),
          with_field<[](auto& s) -> auto& { return s.board.sensors.analog_failed; }>(
              toggle("analog.failed", "The chip's ADC gives no reading of the analogue inputs.")),
      });
}

void add_chips(std::vector<Variable>& table) {
  table.insert(
      table.end(),
      {
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.imu.bias_radps; }>(
              real("imu.bias", "rad/s", -5, 5, "What the gyroscope adds to the yaw rate.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.imu.noise; }>(
              scale("imu.noise", 0, 100,
                    "Relative to the chip's own. Without any, equal samples in a row mean that it "
                    "is frozen.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.imu.freeze; }>(
              toggle("imu.freeze", "The IMU repeats its newest sample.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.imu.absent; }>(
              toggle("imu.absent", "The IMU's plug is off.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.imu.identity; }>(
              whole("imu.identity", "", 0, 255,
                    "What the IMU says it is; 0: the chip that the board names. It stays that "
                    "chip.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.imu.bus_hung; }>(
              toggle("imu.bus_hung",
                     "A line of the IMU's bus is held low. What else is on it hangs, too.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.imu.interrupt_lost; }>(
              toggle("imu.interrupt_lost", "The wire of the IMU's data-ready output is off.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.imu.forward; }>(
              whole("imu.forward", "", -1, 5,
                    "The axis of the IMU's print that points forward, whatever the board says: 0 "
                    "to 5 for x, y, z, -x, -y, -z. Counts together with `imu.up`; -1: as the board "
                    "says.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.imu.up; }>(
              whole("imu.up", "", -1, 5, "The same of the axis that points up.")),
          with_field<[](auto& s) -> auto& { return s.board.sensors.chips.power_absent; }>(
              toggle("power.absent", "The power sensor does not answer.")),
      });
  Variable reset = toggle("imu.reset",
                          "Setting it, the IMU loses its settings once, as by a dip of its supply; "
                          "reads as 0.");
  reset.get = [](const Simulator&) { return 0.0; };
  reset.set = [](Simulator& s, double value) {
    if (value != 0.0) s.board.sensors.chips.reset_imus();
    return true;
  };
  Variable power_reset = reset;
  power_reset.name = "power.reset";
  power_reset.doc = "Setting it, the power sensor loses its settings once; reads as 0.";
  power_reset.set = [](Simulator& s, double value) {
    if (value != 0.0) s.board.sensors.chips.reset_power_sensors();
    return true;
  };
  table.insert(table.end(), {reset, power_reset});
}

void add_device(std::vector<Variable>& table) {
  table.insert(
      table.end(),
      {
          with_field<[](auto& s) -> auto& { return s.board.counts_per_revolution; }>(
              whole("counts_per_revolution", "tick", 4, 200'000, "Of the encoders, x4.")),
          with_field<[](auto& s) -> auto& { return s.board.estop.open; }>(
              toggle("estop_open", "The normally-closed e-stop contact is open.")),
          bumper<Place::kFront>("bumper.front"),
          bumper<Place::kFrontLeft>("bumper.front_left"),
          bumper<Place::kFrontRight>("bumper.front_right"),
          bumper<Place::kRear>("bumper.rear"),
          bumper<Place::kRearLeft>("bumper.rear_left"),
          bumper<Place::kRearRight>("bumper.rear_right"),
          cliff<Place::kFront>("cliff.front"),
          cliff<Place::kFrontLeft>("cliff.front_left"),
          cliff<Place::kFrontRight>("cliff.front_right"),
          cliff<Place::kRear>("cliff.rear"),
          cliff<Place::kRearLeft>("cliff.rear_left"),
          cliff<Place::kRearRight>("cliff.rear_right"),
          cliff<Place::kLeft>("cliff.left"),
          cliff<Place::kRight>("cliff.right"),
          with_field<[](auto& s) -> auto& { return s.board.sensors.stage_fault; }>(
              toggle("stage_fault", "A power stage reports a fault. Needs an input for it.")),
          with_field<[](auto& s) -> auto& { return s.board.battery.volts; }>(
              real("battery_v", "V", 0, 60,
                   "What the battery input senses, less what the supply sags; 0: not measured.")),
          with_field<[](auto& s) -> auto& { return s.board.store.failing; }>(
              toggle("store_failing", "The parameter store cannot be written.")),
          with_field<[](auto& s) -> auto& { return s.board.configuration_store.failing; }>(
              toggle("board_store_failing", "The store of the configuration cannot be written.")),
          with_field<[](auto& s) -> auto& { return s.board_unwritten; }>(
              toggle("board_unwritten",
                     "No board was written or confirmed, as on a fresh chip: nothing drives. From "
                     "the next reset on.")),
          with_field<[](auto& s) -> auto& { return s.board.store.unreadable; }>(
              whole("store_unreadable", "", 0, 0xFFFF,
                    "Why the saved parameters cannot be read, as the fault flag of that "
                    "name; checked when the firmware starts, cleared by a save or a reset.")),
          with_field<[](auto& s) -> auto& { return s.board.flash.faults; }>(
              whole("flash_unreadable", "", 0, 0xFFFF,
                    "Why the flash of parameters, board and e-stop cannot be opened, as the fault "
                    "flag of that name; checked when the firmware starts. Erasing any of the three "
                    "erases all of them.")),
          with_field<[](auto& s) -> auto& { return s.boot_time_us; }>(
              whole("boot_time_us", "us", 0, 60e6, "From a reset to the firmware's start.")),
          with_field<[](auto& s) -> auto& { return s.boot_text; }>(
              toggle("boot_text", "The ROM prints at each reset, at 115200 baud.")),
      });
  Variable clock = real("clock_ppm", "ppm", -10'000, 10'000, "How fast the device's clock runs.");
  clock.get = [](const Simulator& s) { return s.board.clock.ppm(); };
  clock.set = [](Simulator& s, double value) {
    s.board.clock.set_ppm(value, s.board.now());
    return true;
  };
  Variable baud = whole("baud_rate", "1/s", 0, 12e6, "Of the chip's UART; 0: no limit, as on USB.");
  baud.get = [](const Simulator& s) { return static_cast<double>(s.board.line.baud()); };
  baud.set = [](Simulator& s, double value) {
    s.board.line.set_baud(static_cast<uint32_t>(value));
    return true;
  };
  Variable failed = toggle("driver_failed",
                           "A motor or encoder peripheral does not start; set to 0, it starts at "
                           "the next reset.");
  failed.get = [](const Simulator& s) { return s.driver_failed() ? 1.0 : 0.0; };
  failed.set = [](Simulator& s, double value) {
    s.set_driver_failed(value != 0.0);
    return true;
  };
  Variable dump = toggle("core_dump",
                         "Flash holds the core dump of a crash; checked when the firmware starts.");
  dump.get = [](const Simulator& s) { return s.core_dump() ? 1.0 : 0.0; };
  dump.set = [](Simulator& s, double value) {
    s.set_core_dump(value != 0.0);
    return true;
  };
  Variable delay = whole("control_delay_us", "us", 0, 60e6,
                         "Setting it delays the next control step, once; reads as 0.");
  delay.get = [](const Simulator&) { return 0.0; };
  delay.set = [](Simulator& s, double value) {
    s.delay_control(static_cast<uint64_t>(value));
    return true;
  };
  table.insert(table.end(), {clock, baud, failed, dump, delay, wired_board(), floating_level()});
}

void add_readings(std::vector<Variable>& table) {
  table.insert(
      table.end(),
      {
          reading("true.x_m", "m", "Of the middle between the wheels.",
                  [](const Simulator& s) { return s.board.plant.pose().x_m; }),
          reading("true.y_m", "m", "The same.",
                  [](const Simulator& s) { return s.board.plant.pose().y_m; }),
          reading("true.heading_rad", "rad", "Counter-clockwise positive, not wrapped.",
                  [](const Simulator& s) { return s.board.plant.pose().heading_rad; }),
          reading("true.yaw_rate_radps", "rad/s", "Counter-clockwise positive.",
                  [](const Simulator& s) { return s.board.plant.yaw_rate_radps(); }),
          reading("true.roll_rad", "rad", "The right side down positive.",
                  [](const Simulator& s) { return s.board.plant.tilt().roll_rad; }),
          reading("true.pitch_rad", "rad", "The nose down positive.",
                  [](const Simulator& s) { return s.board.plant.tilt().pitch_rad; }),
          reading("true.distance_m", "m", "Length of the centre's path.",
                  [](const Simulator& s) { return s.board.plant.distance_m(); }),
          reading("true.kinetic_energy_j", "J", "Of robot and wheels.",
                  [](const Simulator& s) { return s.board.plant.kinetic_energy_j(); }),
          reading("true.supply_v", "V", "The motor supply, as it sags and the battery empties.",
                  [](const Simulator& s) { return s.board.plant.supply_v(); }),
          reading("t_us", "us", "Simulated time.",
                  [](const Simulator& s) { return static_cast<double>(s.board.now()) * 1e-3; }),
          reading("device_us", "us", "The device's clock, from its reset.",
                  [](const Simulator& s) { return static_cast<double>(s.board.device_us()); }),
          reading("hard_switches", "",
                  "How often a power stage was turned from one direction to the other without a "
                  "pause, since the last reset.",
                  [](const Simulator& s) { return static_cast<double>(s.board.hard_switches()); }),
          reading("pin_conflicts", "",
                  "How many GPIOs the chip drives while an encoder's output, or a contact that is "
                  "closed to ground, drives them, too.",
                  [](const Simulator& s) { return static_cast<double>(s.board.pin_conflicts()); }),
          reading("boot_id", "", "Drawn at each reset.",
                  [](const Simulator& s) { return static_cast<double>(s.boot_id()); }),
          reading("state", "", "The supervisor's, as on the wire.",
                  [](const Simulator& s) { return static_cast<double>(s.state()); }),
          reading("faults", "", "Latched fault flags, as on the wire.",
                  [](const Simulator& s) { return static_cast<double>(s.faults()); }),
          reading("drive_on", "0 or 1", "A power stage drives its winding.",
                  [](const Simulator& s) { return s.record().drive_on ? 1.0 : 0.0; }),
          reading(
              "drive_removed_us", "us", "Device clock when drive_on last ended.",
              [](const Simulator& s) { return static_cast<double>(s.record().drive_removed_us); }),
          reading("deadline_us", "us", "Device clock; of the last setpoint that was accepted.",
                  [](const Simulator& s) { return static_cast<double>(s.record().deadline_us); }),
          reading("stands_still", "0 or 1", "Both wheels are at rest.",
                  [](const Simulator& s) { return s.record().stands_still ? 1.0 : 0.0; }),
          reading("standstill_us", "us", "Device clock when stands_still last began.",
                  [](const Simulator& s) { return static_cast<double>(s.record().standstill_us); }),
          reading("lost_to_device", "byte", "Lost on the way to the firmware: overrun, booting.",
                  [](const Simulator& s) {
                    return static_cast<double>(s.board.line.lost_to_device());
                  }),
          reading(
              "lost_to_host", "byte", "Lost because the host did not read.",
              [](const Simulator& s) { return static_cast<double>(s.board.line.lost_to_host()); }),
      });
}

std::vector<Variable> make_table() {
  std::vector<Variable> table;
  add_world(table);
  add_wheel<kLeft>(table, "left");
  add_wheel<kRight>(table, "right");
  add_hands(table);
  add_device(table);
  add_chips(table);
  add_ranges(table);
  add_readings(table);
  return table;
}

const Variable* find(const std::string& name) {
  static const auto index = [] {
    std::unordered_map<std::string, const Variable*> by_name;
    for (const Variable& variable : variables()) by_name[variable.name] = &variable;
    return by_name;
  }();
  const auto found = index.find(name);
  return found == index.end() ? nullptr : found->second;
}

}  // namespace

const std::vector<Variable>& variables() {
  static const std::vector<Variable> table = make_table();
  return table;
}

VariableStatus set_variable(Simulator& simulator, const std::string& name, double value) {
  const Variable* variable = find(name);
  if (variable == nullptr) return VariableStatus::kUnknownName;
  if (variable->set == nullptr) return VariableStatus::kReadOnly;
  // Written so that NaN fails.
  const bool within = value >= variable->minimum && value <= variable->maximum;
  if (!within || (variable->whole && value != std::floor(value))) {
    return VariableStatus::kOutOfRange;
  }
  return variable->set(simulator, value) ? VariableStatus::kOk : VariableStatus::kOutOfRange;
}

VariableStatus get_variable(const Simulator& simulator, const std::string& name, double& value) {
  const Variable* variable = find(name);
  if (variable == nullptr) return VariableStatus::kUnknownName;
  value = variable->get(simulator);
  return VariableStatus::kOk;
}

}  // namespace wheelwire::sim
