#include "variables.hpp"

#include <cmath>
#include <initializer_list>
#include <numbers>
#include <type_traits>
#include <unordered_map>

#include "reset_reason.hpp"
#include "shipped_boards.hpp"

namespace wheelwire::sim {

namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

/// The description of a variable, before it is bound to what it reads and sets.
Variable real(std::string name, const char* unit, double minimum, double maximum, std::string doc) {
  return {std::move(name), unit, std::move(doc), minimum, maximum};
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

/// Binds a variable to a function that reads it and one that sets it.
Variable with(Variable variable, std::function<double(const Simulator&)> get,
              std::function<bool(Simulator&, double)> set) {
  variable.get = std::move(get);
  variable.set = std::move(set);
  return variable;
}

Variable reading(std::string name, const char* unit, std::string doc,
                 std::function<double(const Simulator&)> get) {
  return with(real(std::move(name), unit, 0, 0, std::move(doc)), std::move(get), nullptr);
}

/// Converts to any field type without a warning; the table's bounds keep it exact.
template <typename Field>
void assign(Field& field, double value) {
  field = static_cast<Field>(value);
}

/// Binds a variable to the field that `field(simulator)` refers to.
template <typename Field>
Variable with_field(Variable variable, Field field) {
  return with(
      std::move(variable), [=](const Simulator& s) { return static_cast<double>(field(s)); },
      [=](Simulator& s, double value) {
        assign(field(s), value);
        return true;
      });
}

/// Binds a variable to the field of the plant's model that `field(model)` refers to.
template <typename Field>
Variable with_model(Variable variable, Field field) {
  return with(
      std::move(variable),
      [=](const Simulator& s) { return static_cast<double>(field(s.board.plant.model())); },
      [=](Simulator& s, double value) {
        PlantModel model = s.board.plant.model();
        assign(field(model), value);
        if (!is_physical(model)) return false;
        s.board.plant.configure(model);
        return true;
      });
}

#define FIELD(path, ...) with_field(__VA_ARGS__, [=](auto& s) -> auto& { return s.path; })
#define MODEL(path, ...) with_model(__VA_ARGS__, [=](auto& m) -> auto& { return m.path; })
// Those whose name is their path.
#define REAL(path, ...) MODEL(path, real(#path, __VA_ARGS__))
#define TOGGLE(path, ...) MODEL(path, toggle(#path, __VA_ARGS__))
#define WHEEL(kind, path, ...) MODEL(wheels[wheel].path, kind(side + "." #path, __VA_ARGS__))
#define ENCODER(path, ...) FIELD(board.encoders[wheel].model.path, __VA_ARGS__)
#define IMU(kind, path, ...) FIELD(board.sensors.chips.imu.path, kind("imu." #path, __VA_ARGS__))
#define GET(value) [=](const Simulator& s) { return static_cast<double>(s.value); }
#define SET(statement)              \
  [=](Simulator& s, double value) { \
    statement;                      \
    return true;                    \
  }

double zero(const Simulator&) { return 0.0; }

std::vector<Variable> world() {
  return {
      MODEL(bridge.supply_v, real("supply_v", "V", 0, 60, "Motor supply, before the bridge.")),
      REAL(supply_ohm, "Ohm", 0, 20, "Of battery and leads: supply and battery input sag."),
      MODEL(battery_ah,
            real("battery.capacity_ah", "A h", 0, 1000, "Of the battery; 0: it never empties.")),
      MODEL(battery_fall_v,
            real("battery.fall_v", "V", 0, 60,
                 "How far supply and battery input fall until the battery is empty.")),
      FIELD(board.plant.used_ah,
            real("battery.used_ah", "A h", 0, 1000, "Drawn by the motors; 0 charges the battery.")),
      FIELD(board.brownout_v,
            real("brownout_v", "V", 0, 60, "A supply below this holds the chip in reset.")),
      REAL(bridge.drop_v, "V", 0, 5, "The L298N's drop at no current."),
      REAL(bridge.drop_ohm, "V/A", 0, 5, "How its drop grows with the current."),
      TOGGLE(bridge.chopped, "The current decays in the PWM's off time, as at a low frequency."),
      REAL(motor.supply_v, "V", 1, 60, "Supply at which the motor's ratings hold."),
      TOGGLE(motor.at_terminals, "The ratings are the motor's alone, without the bridge."),
      REAL(motor.no_load_rpm, "1/min", 10, 2000, "Of the wheel."),
      REAL(motor.stall_current_a, "A", 0.1, 50, "At motor.supply_v."),
      REAL(motor.stall_torque_nm, "N m", 0.005, 10, "At the wheel."),
      REAL(friction.coulomb_nm, "N m", 0, 1, "Of a turning wheel with its gearbox."),
      REAL(friction.static_nm, "N m", 0, 1, "To start a wheel from rest."),
      REAL(friction.viscous_nms, "N m s/rad", 0, 0.1, "Grows with the speed."),
      REAL(mass_kg, "kg", 0.05, 100, "Of the robot."),
      REAL(rotor_inertia_kgm2, "kg m^2", 0, 1, "Of one motor with its wheel, seen at the wheel."),
      REAL(wheel_radius_m, "m", 0.005, 1, "Of both wheels."),
      REAL(wheel_separation_m, "m", 0.02, 5, "Between the wheels' middles."),
      REAL(slope_rad, "rad", -1, 1, "The plane rises along +x."),
      REAL(slip, "", 0, 1,
           "Share of the travel lost when a wheel pushes with its share of the weight; "
           "proportionally less below."),
      TOGGLE(wheels_free, "The robot is raised: its wheels turn, it stays."),
      TOGGLE(motors_swapped, "Each bridge drives the other motor."),
      FIELD(board.wiring.swapped,
            toggle("encoders_swapped", "Each counter has the other encoder.")),
      FIELD(
          board.wiring.both_on,
          whole("encoders_same", "", 0, 2,
                "Both counters have the left encoder (1) or the right one (2); 0: each its own.")),
      FIELD(board.wiring.mixed,
            toggle("channels_mixed", "Each counter has A of one encoder and B of the other.")),
  };
}

std::vector<Variable> hands() {
  return {
      FIELD(board.plant.push.forward_mps,
            real("push.forward_mps", "m/s", -5, 5,
                 "Hands push the robot at this speed; both 0: they let go once it stands.")),
      FIELD(board.plant.push.turn_radps, real("push.turn_radps", "rad/s", -10, 10,
                                              "The same, turned counter-clockwise positive.")),
      FIELD(board.plant.held.roll_rad, real("tilt.roll_rad", "rad", -kTurn / 2, kTurn / 2,
                                            "Hands tilt the robot to this, 1 rad/s, right side "
                                            "down positive. Only the IMU notices.")),
      FIELD(board.plant.held.pitch_rad, real("tilt.pitch_rad", "rad", -kTurn / 2, kTurn / 2,
                                             "The same, the nose down positive.")),
  };
}

std::vector<Variable> wheel_of(Side wheel) {
  const std::string side = wheel == kLeft ? "left" : "right";
  return {
      WHEEL(real, motor_scale, "", 0.2, 3, "No-load speed, relative to the rating."),
      WHEEL(real, torque_scale, "", 0.05, 3, "Torque per ampere, relative to the rating."),
      WHEEL(real, winding_scale, "", 0.2, 20, "The winding's resistance, relative to the rating."),
      WHEEL(real, coulomb_scale, "", 0, 20, "Relative to friction.coulomb_nm."),
      WHEEL(real, static_scale, "", 0, 20, "Relative to friction.static_nm."),
      WHEEL(real, viscous_scale, "", 0, 20, "Relative to friction.viscous_nms."),
      WHEEL(real, radius_scale, "", 0.5, 2, "Relative to wheel_radius_m."),
      WHEEL(real, backlash_rad, "rad", 0, 1, "Play of the gearbox, between encoder and wheel."),
      WHEEL(toggle, motor_reversed, "The motor's wires are swapped."),
      WHEEL(toggle, motor_open, "A wire of the motor is off."),
      WHEEL(real, load_nm, "N m", -10, 10, "Acts against forward motion."),
      WHEEL(real, slip, "", 0, 1, "Share of the wheel's travel lost, as on ice."),
      WHEEL(toggle, blocked, "The wheel is held fast."),
      ENCODER(dead, toggle(side + ".encoder_dead", "A and B are stuck.")),
      ENCODER(reversed, toggle(side + ".encoder_reversed", "A and B are swapped.")),
      ENCODER(stuck, whole(side + ".stuck_channel", "", 0, 2,
                           "Channel whose level never changes: 1 A, 2 B; 0: neither.")),
      ENCODER(stuck, whole(side + ".encoder_stuck", "", 0, 2, "Another name of stuck_channel.")),
      ENCODER(magnet_missing,
              toggle(side + ".magnet_missing",
                     "A twelfth of each turn has no edges; they come together at its end.")),
      ENCODER(lost, real(side + ".encoder_lost", "", 0, 1, "Share of the edges that is lost.")),
      ENCODER(edge_error_ticks, real(side + ".encoder_error_ticks", "tick", 0, 0.45,
                                     "Each edge is off by up to this, the same every turn.")),
      with(real(side + ".hand_turns", "turn", -1000, 1000,
                "Turns by hand, forward positive, one a second; reads as what is left."),
           GET(board.plant.hand_rad(wheel) / kTurn),
           SET(s.board.plant.turn_by_hand(wheel, value * kTurn))),
      reading(side + ".duty", "", "Of the side's bridge, forward positive.",
              GET(board.bridges()[wheel].signed_duty())),
      reading(side + ".shorted", "", "Share of the time in which the winding is shorted.",
              GET(board.bridges()[wheel].shorted())),
      reading(side + ".current_a", "A", "Through the winding.", GET(board.plant.current_a(wheel))),
      reading("true." + side + "_turns", "turn", "By the wheel, behind its gearbox's play.",
              GET(board.plant.wheel_rad(wheel) / kTurn)),
      reading("true." + side + "_slip", "", "Share of the travel that is lost.",
              GET(board.plant.slip(wheel))),
      reading("true." + side + "_mps", "m/s", "Speed at the rim.",
              GET(board.plant.speed_mps(wheel))),
      reading("true." + side + "_ticks", "tick", "An ideal encoder's count.",
              GET(board.encoders[wheel].ticks())),
  };
}

Variable wired_board() {
  std::string doc = "The board that is really wired: ";
  for (size_t i = 0; i < kShippedBoardsOfEsp32; ++i)
    doc += std::to_string(i) + " " + kShippedBoards[i].name + ", ";
  return with(
      whole("wired_board", "", -1, kShippedBoardsOfEsp32 - 1, doc + "-1: the active one."),
      [](const Simulator& s) {
        if (s.board.is_wired_as_active()) return -1.0;
        size_t i = 0;
        while (i < kShippedBoardsOfEsp32 && kShippedBoards[i].board != s.board.wired()) ++i;
        return static_cast<double>(i);
      },
      SET(value < 0.0 ? s.board.wire_as_active()
                      : s.board.wire(kShippedBoards[static_cast<size_t>(value)].board)));
}

std::vector<Variable> joined(std::initializer_list<std::vector<Variable>> parts) {
  std::vector<Variable> all;
  for (const std::vector<Variable>& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

/// What `make(place, its name)` makes of the first `count` places.
template <typename Make>
std::vector<Variable> at_places(size_t count, Make make) {
  constexpr const char* kNames[] = {"front",     "front_left", "front_right", "rear",
                                    "rear_left", "rear_right", "left",        "right"};
  std::vector<Variable> all;
  for (size_t i = 0; i < count; ++i)
    all.push_back(make(static_cast<size_t>(Place::kFront) + i, std::string(kNames[i])));
  return all;
}

Variable bumper(size_t place, const std::string& name) {
  return FIELD(board.sensors.bumpers[place],
               toggle("bumper." + name, "Pressed, or its wire broken. Needs a bumper there."));
}

Variable cliff(size_t place, const std::string& name) {
  return FIELD(board.sensors.cliffs[place],
               toggle("cliff." + name, "No floor below it. Needs a cliff sensor there."));
}

Variable range(size_t place, const std::string& name) {
  return FIELD(board.sensors.ranges.world.distance_m[place],
               real("range." + name + "_m", "m", 0, 20,
                    "Distance of an object; no echo beyond 4.5 m. Needs a range sensor there."));
}

Variable analog(size_t index) {
  return FIELD(board.sensors.analog_v[index],
               real("analog." + std::to_string(index + 1) + "_v", "V", 0, 60,
                    "Before the input's divider. Needs that analogue input."));
}

std::vector<Variable> rangers() {
  return {
      FIELD(board.sensors.ranges.world.absent,
            toggle("range.absent", "The plugs of the range sensors are off.")),
      FIELD(board.sensors.ranges.world.hung,
            toggle("range.hung", "The echo outputs of the range sensors stay high.")),
      analog(0),
      analog(1),
      analog(2),
      analog(3),
      FIELD(board.sensors.analog_failed,
            toggle("analog.failed", "The chip's ADC gives no reading of the analogue inputs.")),
  };
}

std::vector<Variable> chips() {
  return {
    FIELD(board.sensors.chips.imu.bias_radps,
          real("imu.bias", "rad/s", -5, 5, "What the gyroscope adds to the yaw rate.")),
        IMU(real, noise, "", 0, 100,
            "Relative to the chip's own. With 0 the IMU at rest looks frozen."),
        IMU(toggle, freeze, "The IMU repeats its newest sample."),
        IMU(toggle, absent, "The IMU's plug is off."),
        IMU(whole, identity, "", 0, 255, "What the IMU says it is; 0: the board's chip."),
        IMU(toggle, bus_hung, "A line of the IMU's bus is held low; the whole bus hangs."),
        IMU(toggle, interrupt_lost, "The wire of the IMU's data-ready output is off."),
        IMU(whole, forward, "", -1, 5,
            "Axis that really points forward: 0 to 5 for x, y, z, -x, -y, -z. Set `imu.up` "
            "as well; -1: as the board says."),
        IMU(whole, up, "", -1, 5, "Axis that really points up."),
        FIELD(board.sensors.chips.power_absent,
              toggle("power.absent", "The power sensor does not answer.")),
        with(toggle("imu.reset", "The IMU loses its settings, once; reads as 0."), zero,
             SET(if (value != 0.0) s.board.sensors.chips.reset_imus())),
        with(toggle("power.reset", "The power sensor loses its settings, once; reads as 0."), zero,
             SET(if (value != 0.0) s.board.sensors.chips.reset_power_sensors())),
  };
}

std::vector<Variable> inputs() {
  return {
      FIELD(board.counts_per_revolution,
            whole("counts_per_revolution", "tick", 4, 200'000, "Of the encoders, x4.")),
      FIELD(board.estop.open, toggle("estop_open", "The normally-closed e-stop contact is open.")),
  };
}

std::vector<Variable> device() {
  return {
      FIELD(board.sensors.stage_fault,
            toggle("stage_fault", "A power stage reports a fault. Needs an input for it.")),
      FIELD(board.battery.volts,
            real("battery_v", "V", 0, 60,
                 "At the battery input, before the supply sags; 0: not measured.")),
      FIELD(board.store.failing, toggle("store_failing", "The parameter store cannot be written.")),
      FIELD(board.configuration_store.failing,
            toggle("board_store_failing", "The store of the configuration cannot be written.")),
      FIELD(board_unwritten,
            toggle("board_unwritten",
                   "No board is stored or confirmed, from the next reset on: nothing drives.")),
      FIELD(board.store.unreadable,
            whole("store_unreadable", "", 0, 0xFFFF,
                  "The saved parameters are unreadable for the reason that this fault flag names; "
                  "checked at the start, cleared by a save or reset of the parameters.")),
      FIELD(
          board.flash.faults,
          whole("flash_unreadable", "", 0, 0xFFFF,
                "The flash cannot be opened for the reason that this fault flag names; checked at "
                "the start. Resetting the parameters erases parameters, board and e-stop.")),
      FIELD(board.power_cut.writes_left, whole("power_cut_at_write", "", 0, 1000,
                                               "The power fails in this write to flash, counted "
                                               "from now, and is back at once; 0: never.")),
      FIELD(boot_time_us, whole("boot_time_us", "us", 0, 60e6, "From reset to firmware.")),
      FIELD(boot_text, toggle("boot_text", "The ROM prints at each reset, at 115200 baud.")),
      with(real("clock_ppm", "ppm", -10'000, 10'000, "How fast the device's clock runs."),
           GET(board.clock.ppm()), SET(s.board.clock.set_ppm(value, s.board.now()))),
      with(whole("baud_rate", "1/s", 0, 12e6, "Of the chip's UART; 0: no limit, as on USB."),
           GET(board.line.baud()), SET(s.board.line.set_baud(static_cast<uint32_t>(value)))),
      with(toggle("driver_failed",
                  "A motor or encoder peripheral does not start, until 0 and a reset."),
           GET(driver_failed()), SET(s.set_driver_failed(value != 0.0))),
      with(toggle("core_dump",
                  "Flash holds the core dump of a crash; checked when the firmware starts."),
           GET(core_dump()), SET(s.set_core_dump(value != 0.0))),
      with(whole("control_delay_us", "us", 0, 60e6,
                 "Delays the next control step, once; reads as 0."),
           zero, SET(s.delay_control(static_cast<uint64_t>(value)))),
      with(whole("reset", "", 0, kResetReasonNames.size() - 1,
                 "Resets the chip for this ResetReason; reads as the last reset's."),
           GET(reset_reason()), SET(s.reset(static_cast<ResetReason>(value)))),
      wired_board(),
      with(toggle("floating_level",
                  "What a power stage's floating input reads: an L298N's high, others either way."),
           GET(board.floating_level()), SET(s.board.set_floating_level(value != 0.0))),
  };
}

std::vector<Variable> readings() {
  return {
      reading("true.x_m", "m", "Of the middle between the wheels.", GET(board.plant.pose().x_m)),
      reading("true.y_m", "m", "The same.", GET(board.plant.pose().y_m)),
      reading("true.heading_rad", "rad", "Counter-clockwise positive, not wrapped.",
              GET(board.plant.pose().heading_rad)),
      reading("true.yaw_rate_radps", "rad/s", "Counter-clockwise positive.",
              GET(board.plant.yaw_rate_radps())),
      reading("true.roll_rad", "rad", "The right side down positive.",
              GET(board.plant.tilt().roll_rad)),
      reading("true.pitch_rad", "rad", "The nose down positive.",
              GET(board.plant.tilt().pitch_rad)),
      reading("true.distance_m", "m", "Length of the centre's path.",
              GET(board.plant.distance_m())),
      reading("true.kinetic_energy_j", "J", "Of robot and wheels.",
              GET(board.plant.kinetic_energy_j())),
      reading("true.supply_v", "V", "Motor supply, as it sags.", GET(board.plant.supply_v())),
      reading("t_us", "us", "Simulated time.",
              [](const Simulator& s) { return static_cast<double>(s.board.now()) * 1e-3; }),
      reading("device_us", "us", "The device's clock, from its reset.", GET(board.device_us())),
      reading("hard_switches", "",
              "Reversals of a power stage without a pause, since the last reset.",
              GET(board.hard_switches())),
      reading("pin_conflicts", "",
              "GPIOs that the chip drives against an encoder's output or a closed contact.",
              GET(board.pin_conflicts())),
      reading("boot_id", "", "Drawn at each reset.", GET(boot_id())),
      reading("state", "", "The supervisor's, as on the wire.", GET(state())),
      reading("faults", "", "Latched fault flags, as on the wire.", GET(faults())),
      reading("drive_on", "0 or 1", "A power stage drives its winding.", GET(record().drive_on)),
      reading("drive_removed_us", "us", "Device clock when drive_on last ended.",
              GET(record().drive_removed_us)),
      reading("deadline_us", "us", "Device clock; of the last setpoint that was accepted.",
              GET(record().deadline_us)),
      reading("stands_still", "0 or 1", "Both wheels are at rest.", GET(record().stands_still)),
      reading("standstill_us", "us", "Device clock when stands_still last began.",
              GET(record().standstill_us)),
      reading("lost_to_device", "byte", "Lost on the way to the firmware: overrun, booting.",
              GET(board.line.lost_to_device())),
      reading("lost_to_host", "byte", "Lost because the host did not read.",
              GET(board.line.lost_to_host())),
  };
}

#undef FIELD
#undef MODEL
#undef REAL
#undef TOGGLE
#undef WHEEL
#undef ENCODER
#undef IMU
#undef GET
#undef SET

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
  static const std::vector<Variable> table =
      joined({world(), wheel_of(kLeft), wheel_of(kRight), hands(), inputs(), at_places(6, bumper),
              at_places(8, cliff), device(), chips(), at_places(8, range), rangers(), readings()});
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
