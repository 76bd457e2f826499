// The rules of docs/safety.md, each by its code. They look at the robot from outside: at windings,
// wheels, bytes and time.
#pragma once
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <type_traits>

#include "names.hpp"
#include "rule_ids.hpp"
#include "witness.hpp"

namespace wheelwire::explore {

using enum ParameterId;

/// What a stop does, by protocol/SPEC.md.
struct Action {
  StopMode mode = StopMode::kCoast;
  uint64_t until_us = 0;     ///< Of kBrake.
  bool guards = false;       ///< It goes on until the wheels are still.
  bool may_be_less = false;  ///< Another one may have begun, which is weaker and perhaps guards.
};

/// What the rules remember from one look to the next.
struct Memory {
  // As of the last look.
  SupervisorState state = SupervisorState::kBoot;
  std::array<double, 2> duty{};
  bool followed_velocity = false;
  int restarting_steps = 0;  ///< It stopped a moment ago, and its slew restarts.
  std::array<double, 2> commanded_umps{};
  uint64_t commanded_us = 0;  ///< When a wheel was last commanded to turn, in a velocity loop.
  bool followed_duty = false;
  bool default_protection = false;  ///< The wheels' protection had its default values.
  uint32_t faults = 0;
  uint64_t step_us = 0;
  Values values{};
  Values highest{};          ///< The highest of each value since the last step.
  Values earlier_highest{};  ///< Of the step before.
  uint32_t hard_switches = 0;
  /// Which way each winding was driven at the end of the last step: 1, -1 or 0.
  std::array<int, 2> directions{};
  uint64_t stood_since_us = 0;  ///< 0: a wheel turns.

  // S06 and S07.
  struct Wheel {
    uint64_t wrong_since_us = 0;  ///< 0: it does what it should, or need not.
    double slowest = 0.0;         ///< Setpoint since then [m/s].
    // Across stops: how long it was driven hard without a tick, leaking at a tenth of that pace,
    // and the encoder's ticks at the last one.
    double still_us = 0.0;
    int64_t anchor = 0;
  };
  std::array<Wheel, 2> wheels{};
  bool started_at_rest = false;

  // S29. Since when a low battery has limited what is driven; 0: it does not. And how fast the
  // faster wheel was then; of duties, what each may be by now.
  uint64_t limited_since_us = 0;
  double limited_from_umps = 0.0;
  std::array<double, 2> limited_duty{};

  // S34. How long it has been too fast, leaking as above.
  double too_fast_us = 0.0;
  // S28. For how many steps windings have gone against a bumper, in an open loop.
  int against_steps = 0;
  // S28 and S32. Since when a bumper has held it in DRIVING, and how fast it was then.
  uint64_t held_since_us = 0;
  bool was_held = false;  ///< At the end of the last step.
  double held_from_umps = 0.0;

  // S09.
  uint64_t half_since_us = 0;     ///< A block has one copy; 0: it has two, or need not.
  uint64_t unnoted_since_us = 0;  ///< As above, of an e-stop that flash has to record.

  // S27. When a level of the encoder last changed, and when a winding was last driven, or the chip
  // started: it may roll.
  std::array<int64_t, 2> seen_ticks{};
  std::array<bool, 2> was_stuck{};         ///< A level was, at the end of the last step.
  std::array<uint64_t, 2> hid_edges_us{};  ///< An encoder did not show them all.
  std::array<int, 2> hidden_ticks{};  ///< So many may be missed, as a counter has other levels.
  uint64_t turned_us = 0;
  uint64_t ticked_us = 0;          ///< As `turned_us`; 0: not since the start.
  uint64_t perhaps_ticked_us = 0;  ///< A counter may have counted.
  uint64_t drove_us = 0;
  uint64_t driven_us = 0;  ///< A winding was.

  // S35. In how many control steps a wheel has moved on one way, and when it did last.
  struct Turning {
    int way = 0;
    int steps = 0;
    uint64_t ticked_us = 0;
  };
  std::array<Turning, 2> turning{};
  Values known_values{};  ///< After the last message.

  // S13.
  struct Ticks {
    bool known = false;
    bool countable = false;  ///< The firmware counts what the levels show.
    int64_t shown = 0;
    uint32_t expected = 0;
  };
  std::array<Ticks, 2> ticks{};

  // S22.
  uint64_t rolling_since_us = 0;
  double rolled_mps = 0.0;
  bool rolling_told = false;
  uint64_t slow_since_us = 0;  ///< 0: it is not.

  // S23 and S33.
  Action least;  ///< What the stops that were seen have begun for certain.
  Action most;   ///< What they may have begun.
  bool contact_open = false;
  uint64_t contact_since_us = 0;  ///< A message may have noticed it then.
  Trial trial = Trial::kNone;
  int braking_steps = 0;   ///< For how many steps it had to brake.
  int coasting_steps = 0;  ///< For how many steps it had to coast.
  // S09.
  uint64_t fast_us = 0;  ///< When it last did anything but creep on its brake.
};

/// An e-stop's brake goes on until the wheels have been still for half a second: surely until the
/// first time, at most until the second.
constexpr uint64_t kSurelyTurnsUs = 430'000;
constexpr uint64_t kSurelyStillUs = 650'000;

/// What hands and hardware do, as far as rules depend on it. The explorer writes it.
struct World {
  bool wired_as_believed = true;
  /// Which encoders lose their edges in gaps that S06 knows how to notice.
  std::array<bool, 2> loses_in_gaps{};
  /// These, and also encoders whose gaps are too short, too long or too few for it.
  std::array<bool, 2> has_gaps{};
  uint64_t disturbed_us = 0;  ///< Simulated time of the last push, load, slope or defect [us].
  bool ever_disturbed = false;
  uint64_t turned_by_hand_us = 0;  ///< When a wheel was last turned by hand [us], simulated time.
  // Since the last control step:
  bool writes_flash = false;  ///< The step may be late.
  bool handled = false;       ///< A message was handled.
  /// Levels may have jumped, so ticks are unknown from here on.
  bool changed_encoders = false;
};

class Judge {
 public:
  Judge(sim::Simulator& simulator, const Witness& witness, World& world)
      : simulator_(simulator), robot_(simulator.board), witness_(witness), world_(world) {}
  /// The first thing that is wrong, if any.
  const std::optional<Finding>& finding() const { return finding_; }

  void accuse(const Finding& finding) {
    if (!finding.text.empty() && !finding_) finding_ = finding;
  }

  void before_message() {
    time_moves_the_state();
    follow_transition();
  }

  void after_message() {
    // A limit may be raised and lowered again before the step that it was raised for.
    for (size_t i = 0; i < kParameterCount; ++i)
      memory_.highest[i] = std::max(memory_.highest[i], witness_.values()[i]);
    if (!is_driving()) memory_.restarting_steps = 2;
    // A late step may latch a fault that the message behind it clears before the next look.
    if (simulator_.faults() == 0) memory_.faults |= witness_.last_faults;
    driven_by_right();
    stops_before_all_else();
    values_change_at_rest();
    message_moves_the_state();
    drive_only_in_driving();
    follow_message();
  }

  /// `stepped`: a control step has ended; otherwise the firmware only read the line.
  void after_call(bool stepped) {
    time_moves_the_state();
    if (stepped) follow_motion();
    if (stepped) follow_step();
    drive_only_in_driving();
    drives_only_what_it_may();
    driven_by_right();
    values_are_as_acknowledged();
    if (stepped) {
      stops_in_time();
      not_against_a_bumper();
      half_of_the_speed();
      within_limits();
      wheel_fault_in_time();
      driven_hard_without_a_tick();
      not_too_fast();
      sound_robot_drives_on();
      slew_within_limit();
      begins_gently();
      pauses_for_a_period();
      late_step_is_a_fault();
      estop_is_noted();
      lost_copy_is_repaired();
      rolling_is_reported();
      follow_ticks();
      stops_as_asked();
      remember();
    }
  }

  void after_start() {
    const auto outlives = [this](const Action& action) {
      const bool holds = witness_.kept_memory && action.mode == StopMode::kBrakeUntilDriven;
      return holds ? Action{.mode = action.mode} : Action{};
    };
    const uint64_t now = now_us();
    memory_ = {.state = simulator_.state(),
               .faults = simulator_.faults(),
               .step_us = now,
               .values = witness_.values(),
               .highest = witness_.values(),
               .hard_switches = robot_.hard_switches(),
               .hidden_ticks = memory_.hidden_ticks,  // A start does not turn the wheel.
               .turned_us = now,
               .perhaps_ticked_us = now,
               .drove_us = now,
               .known_values = witness_.values(),
               .least = outlives(memory_.least),
               .most = outlives(memory_.most),
               .fast_us = now};
    for (const Side wheel : kSides)
      memory_.ticks[wheel].shown = memory_.seen_ticks[wheel] = robot_.encoders[wheel].shown_ticks();
    if (memory_.state == kEstopped) begin_estop(true);
    // A fault that is found at the start stops it as well.
    if (memory_.state == kEstopped && memory_.faults != 0) begin_action(configured_stop(), false);
    if (memory_.state == kFault) begin_action(configured_stop(), true);
    const bool contact_off =
        witness_.board_confirmed() && witness_.board().estop >= 0 && value(kEstopInputEnabled) == 0;
    check("contact-input-of-its-board"_rule,
          !contact_off || (witness_.flash().parameters &&
                           witness_.flash().parameters_board == checksum(witness_.board())),
          "a board with a contact ignores it, by a value that was saved for another board");
    check("drive-only-in-driving"_rule, !is_driven(), "a winding is driven as the firmware starts");
  }

  void on_state(const WheelState& state) {
    follow_ticks();
    for (const Side wheel : kSides) {
      Memory::Ticks& ticks = memory_.ticks[wheel];
      const auto reported =
          static_cast<uint32_t>(wheel == kLeft ? state.left_ticks : state.right_ticks);
      check("ticks-conserved"_rule, !ticks.known || ticks.expected == reported,
            wheel == kLeft ? "left" : "right", " ticks are ", static_cast<int32_t>(reported),
            ", the encoder's levels make ", static_cast<int32_t>(ticks.expected));
      ticks.known = ticks.countable;
      ticks.expected = reported;
    }
  }

  void on_event(const Event& event) {
    if (event.code != EventCode::kRolling) return;
    memory_.rolling_told = true;
    const bool may_be_held =
        ((witness_.perhaps_forbidden() | witness_.perhaps_held_ways) & kEitherWay) != 0;
    check("rolling-is-reported"_rule, !is_driving() || may_be_held,
          "ROLLING is reported while it drives");
    check("rolling-is-reported"_rule,
          !is_driving() || !memory_.followed_velocity ||
              now_us() - memory_.commanded_us >= kSurelyRollsUs,
          "ROLLING is reported while it slows down beside a bumper");
    // A Stop may have asked to coast.
    const bool brakes = value(kStopMode) >= 2.0f && value(kEstopMode) >= 2.0f &&
                        value(kBrakeTimeS) >= 0.5f && memory_.least.mode != StopMode::kCoast;
    const bool recently_reset = now_us() < 3'000'000;
    const bool measures = is_default(kWheelRadius) && is_default(kCountsPerRevolution) &&
                          robot_.wiring.is_right() && has_no_swaps(witness_.values());
    check("rolling-is-reported"_rule,
          world_.ever_disturbed || !brakes || recently_reset || !measures ||
              !world_.wired_as_believed,
          "ROLLING is reported on a flat floor after a braked stop");
  }

  /// The firmware writes to flash without a request. `creeping`: also while it creeps on the brake
  /// of an e-stop.
  /// S27. A speed of 0 for a moment is not a standstill: the wheel may turn back, or was just
  /// pushed.
  void flash_only_at_rest(bool creeping) {
    const auto ago = [this](uint64_t us) {
      return std::to_string((now_us() - us) / 1000) + " ms ago";
    };
    const bool is_slow = creeping && simulator_.state() == kEstopped && is_shorted() &&
                         moves_slower_than(kRollingVelocityMps);
    check("flash-only-at-rest"_rule, is_slow || now_us() - memory_.turned_us >= kStillUs,
          "it writes to flash, and a wheel turned ", ago(memory_.turned_us));
    check("flash-only-at-rest"_rule, now_us() - memory_.drove_us >= kRunDownUs,
          "it writes to flash, and it drove or started ", ago(memory_.drove_us));
  }

 private:
  using Side = sim::Side;
  using enum sim::Side;
  using enum SupervisorState;
  static constexpr std::array<Side, 2> kSides = sim::kSides;
  static constexpr uint64_t kSlackUs = 10'000;
  /// A wheel that was just pushed or loaded is not what the times of S06 are for.
  static constexpr uint64_t kAfterDisturbanceUs = 3'000'000;
  static constexpr uint64_t kLatchNoteUs = 11'000'000;
  static constexpr uint64_t kRepairUs = 13'000'000;
  static constexpr uint64_t kRollingUs = 1'000'000;
  // Since its command came to zero. The firmware takes 0.3 s.
  static constexpr uint64_t kSurelyRollsUs = 250'000;
  static constexpr uint64_t kMeasuredSlowUs = 300'000;
  /// Less than the firmware waits, by a control step at 100 Hz.
  static constexpr uint64_t kStillUs = 480'000;
  static constexpr uint64_t kRunDownUs = 1'980'000;
  /// The stage pauses first, where the drive was removed.
  static constexpr int kPauseSteps = 4;
  /// The speed that the firmware may measure for a wheel that has just stopped.
  static constexpr double kMeasuredAtRestUmps = 20'000;
  static constexpr uint8_t kEitherWay = reflex::kNoForward | reflex::kNoReverse;
  /// A counter is exact up to half of its range.
  static constexpr int64_t kMostTicksInAStep = 16'000;

  static float default_of(ParameterId id) { return kParameters[index_of(id)].default_value; }

  /// A loop that drives another wheel than it measures, or the other way, holds no robot.
  static bool has_no_swaps(const Values& values) {
    constexpr std::array kSwaps = {kLeftMotorInverted,    kRightMotorInverted, kLeftEncoderInverted,
                                   kRightEncoderInverted, kMotorsSwapped,      kEncodersSwapped};
    return std::ranges::all_of(kSwaps,
                               [&](ParameterId id) { return values[index_of(id)] == 0.0f; });
  }

  /// The rule that a setpoint broke which had to be refused.
  static Rule rule_of(Codes denied, bool unarmed_by_start) {
    if (denied.has(RefusalCode::kBoardUnconfirmed) || denied.has(RefusalCode::kBoardOnTrial))
      return "confirmed-board-only"_rule;
    if (denied.has(RefusalCode::kEstopped) || denied.has(RefusalCode::kFault))
      return "latch-ends-by-clear"_rule;
    if (denied.has(RefusalCode::kUnarmed))
      return unarmed_by_start ? "start-does-not-drive"_rule : "clear-does-not-restart"_rule;
    if (denied.has(RefusalCode::kContradiction)) return "contradictions-never-drive"_rule;
    if (denied.has(RefusalCode::kExpired)) return "deadline-stops"_rule;
    if (denied.has(RefusalCode::kNoTrial)) return "trial-ends-with-its-session"_rule;
    return "session-and-clock-first"_rule;
  }

  static bool hides_edges(const sim::EncoderModel& encoder) {
    return encoder.stuck != 0 || encoder.lost != 0.0 || encoder.dead;
  }

  static double sign_of(double value) { return value > 0.0 ? 1.0 : value < 0.0 ? -1.0 : 0.0; }

  static int direction_of(sim::BridgeState bridge) {
    if (!bridge.drives()) return 0;
    return bridge.is_forward() ? 1 : -1;
  }

  static bool is_latched(SupervisorState state) { return state == kEstopped || state == kFault; }

  /// `otherwise`: the parts of what to say, put together only then.
  template <typename... Parts>
  void check(Rule rule, bool holds, const Parts&... otherwise) {
    if (holds) return;
    std::string text;
    (append(text, otherwise), ...);
    accuse({rule, text});
  }

  template <typename Part>
  static void append(std::string& text, const Part& part) {
    if constexpr (std::is_integral_v<Part>)
      text += std::to_string(part);
    else if constexpr (std::is_floating_point_v<Part>)
      text += text_of(part);
    else
      text += part;
  }

  // --- the winding ------------------------------------------------------------------------------

  /// S01. On a board that is wired otherwise than the firmware believes, windings do what they do.
  void drive_only_in_driving() {
    const bool trusted = world_.wired_as_believed || !witness_.board_confirmed();
    check("drive-only-in-driving"_rule, !trusted || !robot_.drives() || is_driving(),
          "a winding is driven in ", name_of(simulator_.state()));
  }

  /// S02, S03 and S29, at the end of a control step.
  void stops_in_time() {
    check("contact-stops"_rule, !witness_.contact_open() || simulator_.state() == kEstopped,
          "the contact is open, and the robot is in ", name_of(simulator_.state()));
    if (is_driving() && granted_)
      check("deadline-stops"_rule, now_us() < granted_->deadline_us, "it drives ",
            now_us() - granted_->deadline_us, " us after its setpoint's deadline");
    if ((witness_.forbidden() & reflex::kStop) == 0) return;
    check("external-stops"_rule, !is_driving(), "it is in DRIVING, and a sensor has stopped it");
    check("external-stops"_rule, !is_driven(),
          "a winding is driven, and a sensor has stopped the robot");
  }

  /// S05, and the other conditions for a setpoint: S03, S04, S10, S16.
  void driven_by_right() {
    if (!is_driving() || granted_) return;
    accuse({rule_of(witness_.denied, witness_.unarmed_by_start()),
            "it drives without a setpoint that may; the last one had to be refused with " +
                (witness_.denied.empty() ? "nothing" : witness_.denied.text())});
  }

  /// S04, S16 and S18, whenever the firmware has done something.
  void drives_only_what_it_may() {
    // However it is wired: until a board is confirmed its pins float, and on trial it coasts.
    const bool confirmed = witness_.configuration_state == ConfigurationState::kStored;
    check("confirmed-board-only"_rule, confirmed || !is_driving(),
          "it is in DRIVING on a board that nobody confirmed");
    check("confirmed-board-only"_rule, confirmed || !robot_.drives(),
          "a winding is driven on a board that nobody confirmed");
    check("contradictions-never-drive"_rule, !is_driving() || !witness_.contradicts(),
          "it drives with parameters that contradict each other");
    check("no-hard-switch"_rule,
          !world_.wired_as_believed || robot_.hard_switches() <= memory_.hard_switches,
          "a winding's direction changed without a pause");
  }

  // --- wheels -----------------------------------------------------------------------------------

  /// What the wheel is to do, within the limits [m/s].
  double target(Side side) const {
    if (!granted_ || granted_->duty) return 0.0;
    const double peak = std::max(std::abs(granted_->left), std::abs(granted_->right));
    const double limit = value(kMaxVelocityMps);
    const double scale = peak > limit ? limit / peak : 1.0;
    return scale * (side == kLeft ? granted_->left : granted_->right);
  }

  /// Its encoder is dead, its feedback inverted, or it cannot turn. A wheel without a motor may:
  /// what pulls the robot downhill turns it, too.
  bool is_wrong(Side side) const {
    const sim::EncoderModel& encoder = robot_.encoders[side].model;
    const sim::PlantModel& plant = robot_.plant.model();
    const sim::WheelModel& wheel = plant.wheels[side];
    const bool is_level = plant.slope_rad == 0.0 && plant.wheels[kLeft].load_nm == 0.0 &&
                          plant.wheels[kRight].load_nm == 0.0;
    return encoder.dead || encoder.reversed != wheel.motor_reversed ||
           (wheel.motor_open && is_level) || wheel.blocked || world_.loses_in_gaps[side];
  }

  /// All that a wheel's monitoring depends on is as it comes, but for the limits.
  bool has_default_protection() const {
    for (const ParameterSpec& spec : kParameters) {
      if (spec.id == kMaxDuty || spec.id == kMaxVelocityMps || spec.id == kStreamRateHz ||
          spec.id == kTtlMaxS || spec.id == kRearmGapS || spec.id == kRollingVelocityMps ||
          spec.id == kStopMode || spec.id == kBrakeTimeS || spec.id == kEstopInputEnabled ||
          spec.id == kMaxDutyRatePerS || spec.id == kPwmFrequencyHz || spec.id == kGlitchFilterNs)
        continue;
      if (!is_default(spec.id)) return false;
    }
    return value(kMaxDuty) >= 0.15f;
  }

  bool is_default(ParameterId id) const { return witness_.value(id) == default_of(id); }

  /// The firmware knows how many ticks a turn has.
  bool counts_right() const { return value(kCountsPerRevolution) == robot_.counts_per_revolution; }

  /// What the firmware measures is how fast the wheels turn.
  bool measures_right() const {
    return is_default(kWheelRadius) && counts_right() && robot_.wiring.is_right();
  }

  /// Wheels are watched as by default.
  bool is_monitored() const {
    return has_default_protection() && world_.wired_as_believed && robot_.wiring.is_right() &&
           !robot_.plant.model().motors_swapped;
  }

  /// Whether the firmware takes other levels for the same turn of a wheel than in the last step.
  bool reads_encoders_otherwise() const {
    return has_changed(kEncodersSwapped) || has_changed(kLeftEncoderInverted) ||
           has_changed(kRightEncoderInverted);
  }

  /// S06, of one drive.
  void wheel_fault_in_time() {
    const bool drives = is_driving();
    if (drives && memory_.state != kDriving) memory_.started_at_rest = robot_.plant.stands_still();
    const double supply_v = robot_.plant.model().bridge.supply_v;
    const double battery_v = robot_.battery.volts;
    const bool applies = drives && memory_.started_at_rest && is_monitored() && supply_v >= 5.5 &&
                         supply_v <= 12.6 && (battery_v == 0.0 || battery_v == supply_v) &&
                         world_us() > world_.disturbed_us + kAfterDisturbanceUs &&
                         !may_be_held_by_a_bumper();
    for (const Side side : kSides) {
      Memory::Wheel& wheel = memory_.wheels[side];
      const double wanted = target(side);
      if (sign_of(wanted) != sign_of(wheel.slowest)) wheel.wrong_since_us = 0;
      const bool begins = wheel.wrong_since_us == 0;
      follow(wheel.wrong_since_us, applies && is_wrong(side) && std::abs(wanted) >= 0.02);
      if (wheel.wrong_since_us == 0) continue;
      if (begins || std::abs(wanted) < std::abs(wheel.slowest)) wheel.slowest = wanted;
      const uint64_t limit_us = std::abs(wheel.slowest) >= 0.1 ? 1'500'000 : 2'600'000;
      check("wheel-fault-in-time"_rule, now_us() <= wheel.wrong_since_us + limit_us + kSlackUs,
            side == kLeft ? "the left" : "the right",
            " wheel has not done what its setpoint says for ",
            static_cast<double>(now_us() - wheel.wrong_since_us) * 1e-6, " s");
    }
  }

  /// S06, of all drives since a tick or a clear, however short they are.
  void driven_hard_without_a_tick() {
    // The defaults, and the time of a step or two.
    constexpr double kHard = 0.455;
    constexpr double kHardUs = 530'000.0;
    const bool drives = is_driving() && granted_;
    const bool applies = is_monitored() && !world_.changed_encoders;
    const bool is_cleared = memory_.faults != 0 && simulator_.faults() == 0;
    for (const Side side : kSides) {
      Memory::Wheel& wheel = memory_.wheels[side];
      const sim::Quadrature& encoder = robot_.encoders[side];
      const bool counts = encoder.model.stuck != 0 || memory_.hidden_ticks[side] != 0 ||
                          encoder.shown_ticks() != wheel.anchor;
      // At a setpoint of zero the firmware yields to what may be a push.
      const bool yields = drives && !granted_->duty && target(side) == 0.0;
      if (!applies || is_cleared || counts || yields) {
        wheel.anchor = encoder.shown_ticks();
        wheel.still_us = 0.0;
        continue;
      }
      add_up(wheel.still_us, drives && std::abs(duty(side)) >= kHard);
      check("wheel-fault-in-time"_rule, wheel.still_us <= kHardUs,
            side == kLeft ? "the left" : "the right",
            " wheel was driven hard, and its encoder showed no tick");
    }
  }

  /// S07.
  void sound_robot_drives_on() {
    // Values of a trial may have ended with its session in the step that latched the fault.
    if (!memory_.default_protection) return;
    if (world_.ever_disturbed || !has_default_protection() || !world_.wired_as_believed) return;
    constexpr uint32_t kOfWheels = fault::kLeftNotCounting | fault::kRightNotCounting |
                                   fault::kLeftReversed | fault::kRightReversed |
                                   fault::kLeftEncoderImplausible |
                                   fault::kRightEncoderImplausible | fault::kOverspeed;
    check("sound-robot-drives-on"_rule, (simulator_.faults() & ~memory_.faults & kOfWheels) == 0,
          "a sound robot on a flat floor has the faults ", simulator_.faults());
  }

  // --- states -----------------------------------------------------------------------------------

  /// S08 and S21: what may happen to the state without a message.
  void time_moves_the_state() {
    const SupervisorState before = witness_.last_state;
    const SupervisorState after = simulator_.state();
    if (before == after) return;
    const bool trial_is_over =
        witness_.trial == Trial::kExpired ||
        (witness_.trial == Trial::kRuns && now_us() >= witness_.trial_until_us);
    const bool is_early = granted_ && now_us() + kSlackUs < granted_->deadline_us;
    const bool has_reason = (after == kFault && simulator_.faults() != 0) ||
                            (after == kEstopped && witness_.contact_open()) ||
                            (after == kTimedOut && before == kDriving && !is_early) ||
                            (after == kIdle && trial_is_over);
    const bool ends_latch = is_latched(before) && after != kEstopped;
    check(ends_latch ? "latch-ends-by-clear"_rule : "state-by-its-table"_rule,
          has_reason && !ends_latch, "from ", name_of(before), " to ", name_of(after),
          " without a reason");
  }

  /// S08 and S21: what a message makes of the state.
  void message_moves_the_state() {
    const Task& task = *witness_.task;
    const SupervisorState before = task.before;
    const SupervisorState after = simulator_.state();
    const bool moves = before == kDriving || before == kTimedOut;
    SupervisorState expected = before;
    const bool acts = task.carried_out && task.is_new;
    const uint8_t id = task.message.id;
    if (id == Estop::kId) {
      expected = kEstopped;
    } else if (id == Stop::kId || (id == Hello::kId && acts)) {
      if (moves) expected = kIdle;
    } else if (is_setpoint(id) && acts) {
      expected = kDriving;
    } else if (id == ClearEstop::kId && acts && before == kEstopped) {
      expected = simulator_.faults() != 0 ? kFault : kIdle;
    } else if (id == ClearFault::kId && acts && before == kFault) {
      expected = kIdle;
    }
    if (after == expected) return;
    const bool may_notice_contact =
        task.is_new &&
        (id == ParameterSet::kId || id == ParameterReset::kId || id == Restart::kId ||
         id == ConfigurationWrite::kId || id == ConfigurationConfirm::kId);
    // A setpoint that is to drive shows that a sensor has stopped the robot.
    if (is_setpoint(id) && !task.is_zero && after == kFault &&
        (witness_.perhaps_forbidden() & reflex::kStop) != 0 &&
        (simulator_.faults() & fault::kExternal) != 0)
      return;
    if (may_notice_contact && after == kEstopped && witness_.contact_open()) return;
    // It reverts a trial, by its end or its deadline.
    if (id == ParameterTrial::kId && moves && after == kIdle) return;
    const Rule rule = id == Estop::kId || id == Stop::kId ? "stop-at-once"_rule
                      : is_latched(before)                ? "latch-ends-by-clear"_rule
                                                          : "state-by-its-table"_rule;
    accuse({rule, describe(task.message) + (task.carried_out ? "" : ", not carried out,") +
                      " moves it from " + name_of(before) + " to " + name_of(after) +
                      " instead of " + name_of(expected)});
  }

  /// S20 and S26.
  void stops_before_all_else() {
    const Task& task = *witness_.task;
    const uint8_t id = task.message.id;
    if (id == Stop::kId || id == Estop::kId)
      check("stop-at-once"_rule, !is_driven(), "a winding is driven after ",
            describe(task.message));
    if (id != ConfigurationWrite::kId && id != ConfigurationConfirm::kId) return;
    const bool estopped = task.before == kEstopped || witness_.contact_open();
    check("board-stays-while-estopped"_rule,
          !task.carried_out || !task.is_new || !estopped || !witness_.board_confirmed(),
          describe(task.message), " is carried out with an e-stop");
  }

  /// S35, but for a trial, which stops the robot as it ends, and DRIVING, which S17 knows.
  void values_change_at_rest() {
    const Task& task = *witness_.task;
    const Values before = std::exchange(memory_.known_values, witness_.values());
    if (!task.carried_out || !task.is_new) return;
    if (task.message.id != ParameterSet::kId && task.message.id != ParameterReset::kId) return;
    for (const ParameterSpec& spec : kParameters) {
      const bool has_changed = before[index_of(spec.id)] != witness_.value(spec.id);
      if (!has_changed || spec.changes == ParameterChanges::kAlways) continue;
      check("values-change-at-rest"_rule, !surely_turns(kLeft) && !surely_turns(kRight),
            describe(task.message), " is carried out though a wheel turns");
    }
  }

  bool surely_turns(Side wheel) const {
    const Memory::Turning& turning = memory_.turning[wheel];
    const int64_t moved = robot_.encoders[wheel].shown_ticks() - memory_.seen_ticks[wheel];
    const bool turns_back = moved != 0 && (moved > 0) != (turning.way > 0);
    return turning.steps > 2 && !turns_back && !world_.changed_encoders &&
           now_us() - turning.ticked_us < kSurelyTurnsUs;
  }

  // --- limits -----------------------------------------------------------------------------------

  /// S11.
  void slew_within_limit() {
    if (!is_driving() || !granted_ || memory_.state != kDriving) return;
    const double period_s = 1.0 / value(kControlRateHz);
    if (granted_->duty && memory_.followed_duty && memory_.restarting_steps == 0) {
      // The first step of a pause may have been one with the limit before.
      const double rate = highest_of_two_steps(kMaxDutyRatePerS);
      // Where the direction changes the stage pauses for a step, and for another to begin.
      const double step = 1.3 * rate * period_s + 2.0 / 32767.0;
      for (const Side side : kSides) {
        const double before = memory_.duty[side];
        const double now = duty(side);
        const bool pauses = before == 0.0 || sign_of(before) != sign_of(now);
        const double growth = pauses ? std::abs(now) : std::abs(now) - std::abs(before);
        check("slew-within-limit"_rule,
              !world_.wired_as_believed || growth <= step * (pauses ? 2 : 1), "a duty goes from ",
              before, " to ", now, " in one step");
      }
    }
    if (granted_->duty || !memory_.followed_velocity || memory_.restarting_steps > 0) return;
    // A reflex may stop it, and let it start again, at any step. An open loop then starts from
    // zero.
    if (witness_.perhaps_forbidden() != 0 || witness_.perhaps_held_ways != 0 || memory_.was_held)
      return;
    const double acceleration = highest(kMaxAccelerationMps2);
    const double step_umps = acceleration * period_s * 1e6;
    for (const Side side : kSides) {
      const double change = std::abs(commanded_umps(side) - memory_.commanded_umps[side]);
      check("slew-within-limit"_rule, change <= 1.3 * step_umps + 2.0,
            "a wheel's command changes by ", change, " um/s in a step of ", step_umps);
    }
  }

  /// S11: wheels that stand are commanded from standstill on.
  void begins_gently() {
    const bool begins = memory_.state != kDriving || memory_.restarting_steps > 0;
    // With other values its last ticks may look like any speed.
    for (const ParameterId id : {kWheelRadius, kCountsPerRevolution, kVelocityWindowUs})
      if (!is_default(id)) return;
    // A wheel that was turned by hand has a speed, too.
    if (!begins || !granted_ || granted_->duty || memory_.stood_since_us == 0 ||
        now_us() < memory_.stood_since_us + kMeasuredSlowUs ||
        world_us() < world_.turned_by_hand_us + kMeasuredSlowUs)
      return;
    const double step_umps = value(kMaxAccelerationMps2) / value(kControlRateHz) * 1e6;
    for (const Side side : kSides) {
      const double commanded = std::abs(commanded_umps(side));
      check("slew-within-limit"_rule, commanded <= 1.3 * 2.0 * step_umps + kMeasuredAtRestUmps,
            "a wheel that stands is commanded at ", commanded, " um/s in a step of ", step_umps);
    }
  }

  /// S19.
  void within_limits() {
    if (!is_driving() || !world_.wired_as_believed) return;
    for (const Side side : kSides) {
      const double before = memory_.duty[side];
      const double now = duty(side);
      // A limit that was lowered takes effect within the slew limit. The first step of a pause may
      // have been one with the limit before.
      const bool falls = std::abs(now) < std::abs(before);
      const bool pauses = before == 0.0 || sign_of(before) != sign_of(now);
      const double limit = pauses ? highest_of_two_steps(kMaxDuty) : highest(kMaxDuty);
      check("within-limits"_rule, std::abs(now) <= limit + 2.0 / 32767.0 || falls, "a duty of ",
            std::abs(now), " of ", limit);
    }
  }

  /// S18, at the end of a control step: a pause within a step does not count, because current still
  /// flows.
  void pauses_for_a_period() {
    if (!world_.wired_as_believed) return;
    const bool can_coast = kStageTables[static_cast<size_t>(witness_.board().stage)].can_coast;
    for (const Side side : kSides) {
      const int before = memory_.directions[side];
      const sim::BridgeState now = robot_.bridges()[side];
      check("no-hard-switch"_rule, before * direction_of(now) >= 0,
            "a winding is driven the other way one control period later");
      check("no-hard-switch"_rule, before == 0 || now.drives() || now.shorted() < 0.5 || !can_coast,
            "a winding that was driven is shorted one control period later");
    }
  }

  /// S12, S14, S15.
  void values_are_as_acknowledged() {
    for (size_t i = 0; i < kParameterCount; ++i) {
      const float now = simulator_.parameter(kParameters[i].id);
      if (now == witness_.values()[i]) continue;
      const Rule rule = witness_.task && witness_.task->is_repeat ? "request-once"_rule
                        : now == memory_.values[i] ? "trial-ends-with-its-session"_rule
                                                   : "answers-as-specified"_rule;
      return accuse({rule, "parameter " + std::to_string(i + 1) + " is " +
                               text_of(static_cast<double>(now)) + " instead of " +
                               text_of(static_cast<double>(witness_.values()[i]))});
    }
  }

  /// S25.
  void late_step_is_a_fault() {
    const bool was_driving = memory_.state == kDriving;
    const uint64_t elapsed_us = now_us() - memory_.step_us;
    // A trial that ends in this very step stops the robot before.
    const bool applies = was_driving && !world_.handled && !world_.writes_flash &&
                         witness_.trial != Trial::kExpired &&
                         static_cast<double>(elapsed_us) > value(kOverrunLimitUs);
    check("late-step-is-a-fault"_rule,
          !applies || (simulator_.faults() & fault::kControlOverrun) != 0,
          "a control step came after ", elapsed_us, " us without a fault");
  }

  // --- sensors ----------------------------------------------------------------------------------

  /// Whether what holds a robot at a bumper, the velocity loop, still commands a speed although it
  /// has had the time to bring it to rest from the speed that it had.
  bool is_to_stand() {
    // The loop slows down what it measures: with other counts or another radius, another speed.
    const double measured_umps = 1.3e6 * static_cast<double>(robot_.counts_per_revolution) /
                                 value(kCountsPerRevolution) * value(kWheelRadius) /
                                 static_cast<double>(default_of(kWheelRadius));
    if (memory_.held_since_us == 0 || has_changed(kMaxAccelerationMps2)) {
      memory_.held_since_us = now_us();
      memory_.held_from_umps = std::max(commanded_umps(), measured_umps * speed_mps());
    }
    const double needed_s = memory_.held_from_umps * 1e-6 / value(kMaxAccelerationMps2) + 2.0;
    const double held_s = static_cast<double>(now_us() - memory_.held_since_us) * 1e-6;
    return held_s > needed_s && commanded_umps() != 0.0;
  }

  /// S28 and S32, at the end of a control step.
  void not_against_a_bumper() {
    const uint8_t open = witness_.forbidden() & kEitherWay;
    const uint8_t forbidden = open | witness_.held_ways;
    if (!is_driving() || !granted_ || !world_.wired_as_believed || forbidden == 0) {
      memory_.against_steps = 0;
      memory_.held_since_us = 0;
      return;
    }
    const auto goes = [this](Side side) {
      const Side wheel = value(kMotorsSwapped) != 0 ? other(side) : side;
      const bool inverted = value(wheel == kLeft ? kLeftMotorInverted : kRightMotorInverted) != 0;
      if (!granted_->duty) return commanded_umps(side);
      return inverted ? -duty(side) : duty(side);
    };
    bool is_against = false;
    bool is_held = false;
    for (const uint32_t flag : {reflex::kNoForward, reflex::kNoReverse}) {
      if ((forbidden & flag) == 0) continue;
      const double way = flag == reflex::kNoForward ? 1.0 : -1.0;
      const char* const name = way > 0.0 ? "forward" : "backward";
      const Rule rule =
          (open & flag) != 0 ? "not-against-a-bumper"_rule : "release-does-not-restart"_rule;
      for (const Side side : kSides) {
        // Where a winding changes its direction its stage pauses, and the other one begins.
        if (way * goes(side) <= 2.0 / 32767.0) continue;
        is_against = true;
        check(rule, granted_->duty && memory_.against_steps < 2, "a wheel is to turn ", name,
              " against a bumper");
      }
      if ((granted_->ways & flag) == 0) continue;
      is_held = true;
      // An open loop cannot hold it there, and what holds it afterwards starts again.
      if (granted_->duty) memory_.held_since_us = 0;
      check(rule, !granted_->duty || !robot_.drives(),
            "a winding is driven, and a bumper forbids to go ", name);
      check(rule, granted_->duty || !is_to_stand(), "it is to stand, as a bumper forbids to go ",
            name);
    }
    if (!is_held) memory_.held_since_us = 0;
    memory_.against_steps = is_against ? memory_.against_steps + 1 : 0;
  }

  /// S29: half of the limits, which it approaches within the slew limit.
  void half_of_the_speed() {
    const bool applies = (witness_.forbidden() & reflex::kLimit) != 0 && granted_ && is_driving() &&
                         memory_.state == kDriving && world_.wired_as_believed &&
                         memory_.restarting_steps == 0 &&
                         (granted_->duty ? memory_.followed_duty : memory_.followed_velocity);
    if (!applies) {
      memory_.limited_since_us = 0;
      return;
    }
    // A limit that is lowered takes effect as fast as the slew limit allows, as well.
    const bool begins = memory_.limited_since_us == 0 || has_changed(kMaxVelocityMps) ||
                        has_changed(kMaxAccelerationMps2);
    if (begins || has_changed(kMaxDuty)) {
      for (const Side side : kSides)
        memory_.limited_duty[side] =
            std::max(memory_.limited_duty[side], std::abs(memory_.duty[side]));
    }
    if (begins) {
      memory_.limited_since_us = now_us();
      memory_.limited_from_umps = std::max(std::abs(memory_.commanded_umps[kLeft]),
                                           std::abs(memory_.commanded_umps[kRight]));
    }
    if (granted_->duty) {
      // It falls to half, at nearly the slew limit: of two wheels the slower one keeps their ratio.
      const double period_s = 1.0 / value(kControlRateHz);
      const double fall = 0.4 * value(kMaxDutyRatePerS) * period_s;
      for (const Side side : kSides) {
        const double now = std::abs(duty(side));
        double& most = memory_.limited_duty[side];
        // A step for what was on its way, and another one for the pause of the stage.
        check("external-stops"_rule,
              now <= std::max(highest(kMaxDuty) / 2.0, most) + 2.0 * fall + 2.0 / 32767.0,
              "a duty of ", now, " with a low battery");
        most = std::max(0.0, most - fall);
      }
      return;
    }
    const double half_umps = highest(kMaxVelocityMps) / 2.0 * 1e6;
    const double falls_s =
        std::max(half_umps, memory_.limited_from_umps) * 1e-6 / value(kMaxAccelerationMps2) + 0.5;
    // Before that one wheel may still gain: its correction is limited by the speed of the faster
    // one.
    if (static_cast<double>(now_us() - memory_.limited_since_us) * 1e-6 <= falls_s) return;
    for (const Side side : kSides) {
      const double now = std::abs(commanded_umps(side));
      check("external-stops"_rule, now <= 1.001 * half_umps + 10.0, "a wheel is commanded at ", now,
            " um/s with a low battery");
    }
  }

  /// S34: a mean speed 1.5 times the allowed one, for a second in all, is a fault.
  void not_too_fast() {
    // What the firmware measures lags, and is noisy.
    constexpr double kMargin = 1.1;
    constexpr double kTooFastUs = 1'150'000.0;
    bool applies = is_driving() && memory_.state == kDriving && granted_ && !granted_->duty &&
                   !may_be_held_by_a_bumper() && has_default_protection() &&
                   world_.wired_as_believed && robot_.wiring.is_right() && counts_right();
    double sum = 0.0;
    double allowed = highest(kMaxVelocityMps);
    for (const Side side : kSides) {
      const sim::EncoderModel& encoder = robot_.encoders[side].model;
      applies = applies && !hides_edges(encoder) && !world_.has_gaps[side];
      sum += speed_mps(side);
      allowed = std::max(allowed, std::abs(commanded_umps(side)) * 1e-6);
    }
    if (robot_.drives()) memory_.driven_us = now_us();
    const double brake_us = 1e6 * highest(kBrakeTimeS);
    // A bumper ended the drive: the brake acts before the loop does.
    const bool slides = (witness_.perhaps_forbidden() & kEitherWay) != 0 &&
                        memory_.driven_us != now_us() &&
                        static_cast<double>(now_us() - memory_.driven_us) <= brake_us;
    applies = applies && !slides;
    const bool is_cleared = memory_.faults != 0 && simulator_.faults() == 0;
    const bool obeys = applies && sum <= 2.0 * kMargin * allowed;
    if (is_cleared || obeys)
      memory_.too_fast_us = 0.0;
    else
      add_up(memory_.too_fast_us, applies && sum > 3.0 * kMargin * allowed);
    check("not-too-fast"_rule, memory_.too_fast_us <= kTooFastUs, "it rolls at ", sum / 2.0,
          " m/s, may do ", allowed, ", and goes on");
  }

  // --- at rest ----------------------------------------------------------------------------------

  /// S09: flash records an e-stop once the wheels stand, and its end.
  void estop_is_noted() {
    const bool estopped = simulator_.state() == kEstopped;
    // For a wheel that hardly turns, the firmware's measurement differs from its true speed.
    if (!(estopped && creeps(0.5))) memory_.fast_us = now_us();
    const bool is_slow = now_us() > memory_.fast_us + kMeasuredSlowUs + kRunDownUs;
    const bool rests = (robot_.plant.stands_still() || (estopped && is_slow)) && !is_driving() &&
                       !robot_.latch_store.failing && robot_.flash.faults == 0;
    follow(memory_.unnoted_since_us, estopped != witness_.flash().estop && rests);
    check("estop-survives-power-loss"_rule, !lasts(memory_.unnoted_since_us, kLatchNoteUs),
          estopped ? "an e-stop" : "its end", " was not recorded in flash");
  }

  /// S30: a copy that the start found lost is rewritten.
  void lost_copy_is_repaired() {
    const sim::SimulatedBoard& board = simulator_.board;
    const bool rests = board.plant.stands_still() && !is_driving() &&
                       !board.configuration_store.failing && !board.store.failing &&
                       !board.latch_store.failing && board.flash.faults == 0 &&
                       board.store.unreadable == 0 && board.configuration_store.unreadable == 0;
    follow(memory_.half_since_us, rests && witness_.has_lost_copy());
    check("lost-is-not-empty"_rule, !lasts(memory_.half_since_us, kRepairUs),
          "a lost copy of a stored block was not written anew");
  }

  // --- what a stop does -------------------------------------------------------------------------

  /// A stop in `mode`. Of one that is not `certain` only what it may do is known; of one that was
  /// noticed before only since when it acts at least.
  void begin_action(StopMode mode, bool certain, bool weakens = false, uint64_t since_us = 0) {
    const auto brake_us = static_cast<uint64_t>(value(kBrakeTimeS) * 1e6);
    const auto period_us = static_cast<uint64_t>(1e6 / value(kControlRateHz));
    const auto begin = [mode, certain, weakens](Action& action, uint64_t until_us) {
      if (mode < action.mode && !weakens) return;
      // A stop as strong as the one before it leaves it its guard and its time.
      const bool may_last = mode == action.mode || (action.may_be_less && mode != StopMode::kCoast);
      if (mode < action.mode && !may_last) action.guards = false;
      if (mode != action.mode) action.may_be_less = mode > action.mode && !certain;
      action.until_us = may_last ? std::max(action.until_us, until_us) : until_us;
      action.mode = mode;
    };
    const uint64_t at_least_us = (since_us != 0 ? since_us : now_us()) + brake_us;
    if (certain) begin(memory_.least, at_least_us - std::min(at_least_us, kSlackUs));
    begin(memory_.most, now_us() + brake_us + 2 * period_us + kSlackUs);
  }

  void begin_estop(bool certain, uint64_t since_us = 0) {
    const auto stop_mode = configured_stop();
    auto mode = static_cast<StopMode>(value(kEstopMode));
    if (mode != StopMode::kCoast && stop_mode == StopMode::kBrakeUntilDriven) mode = stop_mode;
    begin_action(mode, certain, false, since_us);
    if (mode == StopMode::kCoast) return;
    memory_.most.guards = true;
    if (certain) memory_.least.guards = true;
  }

  /// One that only a power stage reports coasts; at one of overspeed the brake lasts.
  void begin_fault(uint32_t new_faults) {
    if ((new_faults & fault::kOverspeed) != 0)
      return begin_action(StopMode::kBrakeUntilDriven, true);
    const bool may_be_of_stage = (new_faults & fault::kExternal) != 0;
    begin_action(configured_stop(), !may_be_of_stage);
  }

  /// What the message that was just handled begins.
  void follow_message() {
    const Task& task = *witness_.task;
    const SupervisorState after = simulator_.state();
    const StopMode configured = configured_stop();
    const uint8_t id = task.message.id;
    if (after == kBoot) return;
    if (id == Stop::kId) {
      const auto stop = task.message.as<Stop>();
      const bool by_session = witness_.session.open && stop.session_id == witness_.session.id;
      const bool is_named = stop.mode != StopMode::kConfigured &&
                            stop.mode <= StopMode::kBrakeUntilDriven &&
                            (by_session || stop.mode > configured);
      const bool weakens = is_named && by_session && !is_latched(task.before);
      begin_action(is_named ? stop.mode : configured, true, weakens);
    } else if (id == Estop::kId) {
      begin_estop(true);
    } else if (id == Hello::kId && task.is_new && task.carried_out) {
      begin_action(configured, true);
    } else if (id == ParameterTrial::kId) {
      begin_action(configured, task.before == kDriving && after != kDriving);
    } else if (after == kFault && task.before != after) {
      begin_fault(simulator_.faults() & ~witness_.last_faults);
    } else if (id == ParameterSet::kId || id == ParameterReset::kId) {
      // One that notices the contact stops by the values before it, and may change them.
      const bool is_noticed = witness_.contact_open() && !memory_.contact_open;
      if (is_noticed || task.before != after) begin_action(StopMode::kBrakeUntilDriven, false);
      if (is_noticed) memory_.most.guards = true;
      memory_.contact_open = memory_.contact_open || is_noticed;
    } else if (witness_.contact_open()) {
      // On an e-stopped robot it cannot be seen whether this message or the next step notices it.
      if (!memory_.contact_open && memory_.contact_since_us == 0)
        memory_.contact_since_us = now_us();
      begin_estop(task.before != after);
      memory_.contact_open = memory_.contact_open || task.before != after;
    }
    // The next drive, maybe before the next control step, begins at what the wheels do then.
    if (after != kDriving) memory_.held_since_us = 0;
    if (after == kDriving) memory_.least = memory_.most = {};
  }

  /// What begins as the state changes without a message.
  void follow_transition() {
    const SupervisorState before = witness_.last_state;
    const SupervisorState after = simulator_.state();
    const StopMode configured = configured_stop();
    const uint32_t new_faults = simulator_.faults() & ~witness_.last_faults;
    if (witness_.trial == Trial::kExpired && memory_.trial == Trial::kRuns)
      begin_action(configured, before == kDriving);
    memory_.trial = witness_.trial;
    if (new_faults != 0 || (after == kFault && before != after)) begin_fault(new_faults);
    if (before == kDriving && after == kTimedOut) begin_action(configured, true);
    if (before != kEstopped && after == kEstopped) begin_estop(true);
  }

  /// What a control step begins, and ends.
  void follow_step() {
    follow_transition();
    const SupervisorState after = simulator_.state();
    if (witness_.contact_open() && !memory_.contact_open)
      begin_estop(true, memory_.contact_since_us);
    memory_.contact_open = witness_.contact_open();
    memory_.contact_since_us = 0;
    if (after == kDriving) memory_.least = memory_.most = {};
    // Once the e-stop is cleared its brake ends as soon as the wheels are still.
    if (after == kEstopped) return;
    if (!surely_turns()) memory_.least.guards = false;
    if (surely_still() && now_us() >= memory_.most.until_us) memory_.most.guards = false;
  }

  /// Of a value since the last control step, in which it may have been raised and lowered again.
  double highest(ParameterId id) const {
    return std::max(value(id), static_cast<double>(memory_.highest[index_of(id)]));
  }

  double highest_of_two_steps(ParameterId id) const {
    return std::max(highest(id), static_cast<double>(memory_.earlier_highest[index_of(id)]));
  }

  /// Keeps since when something holds; 0: it does not.
  void follow(uint64_t& since_us, bool holds) const {
    if (!holds || since_us == 0) since_us = holds ? now_us() : 0;
  }

  /// Adds up for how long something holds; what is in sum leaks at a tenth of that pace.
  void add_up(double& sum_us, bool holds) const {
    const double period_us = 1e6 / value(kControlRateHz);
    sum_us = holds ? sum_us + period_us : std::max(0.0, sum_us - period_us / 10.0);
  }

  bool is_shorted() const {
    const auto bridges = robot_.bridges();
    return bridges[kLeft].shorted() > 0.5 && bridges[kRight].shorted() > 0.5;
  }

  /// As far as its encoders show, with room for what is measured late.
  bool moves_slower_than(ParameterId limit) const {
    for (const Side side : kSides) {
      const sim::EncoderModel& encoder = robot_.encoders[side].model;
      // The first edges of one that comes back show no speed yet.
      if (hides_edges(encoder) || now_us() - memory_.hid_edges_us[side] < kStillUs) return true;
    }
    return !measures_right() || speed_mps() < 1.5 * value(limit) + 0.05;
  }

  /// On the brake, at this share of rolling_velocity_mps at most, by encoders that show it.
  bool creeps(double share) const {
    for (const Side side : kSides) {
      const sim::EncoderModel& encoder = robot_.encoders[side].model;
      if (encoder.stuck != 0 || encoder.lost != 0.0) return false;
    }
    return measures_right() && is_default(kVelocityWindowUs) && world_.wired_as_believed &&
           speed_mps() <= share * value(kRollingVelocityMps) && is_shorted();
  }

  /// S23 and S33, at the end of a control step.
  void stops_as_asked() {
    const SupervisorState state = simulator_.state();
    if (state == kDriving || state == kBoot || !world_.wired_as_believed) {
      memory_.braking_steps = memory_.coasting_steps = 0;
      return;
    }
    const bool may_brake = witness_.configuration_state == ConfigurationState::kStored;
    const auto asks = [this](const Action& action, bool turns) {
      if (action.mode != StopMode::kBrake) return action.mode == StopMode::kBrakeUntilDriven;
      return now_us() < action.until_us || (action.guards && turns);
    };
    const bool brakes = may_brake && asks(memory_.least, surely_turns());
    const bool coasts = !may_brake || !asks(memory_.most, !surely_still());
    memory_.braking_steps = brakes ? memory_.braking_steps + 1 : 0;
    memory_.coasting_steps = coasts ? memory_.coasting_steps + 1 : 0;
    const bool can_coast = witness_.configuration_state != ConfigurationState::kDamaged &&
                           kStageTables[static_cast<size_t>(witness_.board().stage)].can_coast;
    const bool began = memory_.braking_steps == kPauseSteps;
    for (const Side side : kSides) {
      const double shorted = robot_.bridges()[side].shorted();
      if (memory_.braking_steps >= kPauseSteps)
        check(began ? "stops-as-asked"_rule : "stop-holds"_rule, shorted > 0.5,
              began ? "a winding is not braked after a stop that brakes"
                    : "a winding that a stop has shorted is open");
      if (memory_.coasting_steps >= kPauseSteps && can_coast)
        check(may_brake ? "stops-as-asked"_rule : "confirmed-board-only"_rule, shorted == 0.0,
              may_brake ? "a winding is braked after a stop that coasts"
                        : "a winding is braked on a board that nobody confirmed");
    }
  }

  /// Whether a bumper keeps a robot in DRIVING from what its setpoint says, by flags of `reflex`.
  bool is_held_by_a_bumper(uint32_t ways) const { return granted_ && (ways & granted_->ways) != 0; }
  bool may_be_held_by_a_bumper() const {
    return is_held_by_a_bumper(witness_.perhaps_forbidden() | witness_.perhaps_held_ways);
  }

  /// S22.
  void rolling_is_reported() {
    const double threshold = value(kRollingVelocityMps);
    const double speed = speed_mps();
    bool sound =
        measures_right() && world_.wired_as_believed && value(kVelocityWindowUs) <= 50'000.0f;
    for (const Side side : kSides) sound = sound && !hides_edges(robot_.encoders[side].model);
    // At a bumper, the loop still slows it down, as fast as allowed.
    const bool slows_down = commanded_umps() != 0.0;
    const bool is_held =
        !is_driving() ||
        (!slows_down && is_held_by_a_bumper(witness_.forbidden() | witness_.held_ways));
    const bool rolls =
        sound && witness_.session.open && threshold > 0.0 && is_held && speed > 1.3 * threshold;
    // It is reported once until it is slow: for long enough to be measured.
    follow(memory_.slow_since_us, speed < 0.4 * threshold);
    if (lasts(memory_.slow_since_us, kMeasuredSlowUs)) memory_.rolling_told = false;
    if (speed < memory_.rolled_mps) memory_.rolling_since_us = 0;
    follow(memory_.rolling_since_us, rolls);
    memory_.rolled_mps = rolls ? speed : 0.0;
    check("rolling-is-reported"_rule,
          memory_.rolling_told || !lasts(memory_.rolling_since_us, kRollingUs), "it rolls at ",
          speed, " m/s without drive, and nobody reports it");
  }

  // --- ticks ------------------------------------------------------------------------------------

  /// S13. What each total should be by what the encoders' levels showed.
  void follow_ticks() {
    const bool swapped = (value(kEncodersSwapped) != 0) != robot_.wiring.swapped;
    const bool known = shows_wheels() && !world_.changed_encoders && !reads_encoders_otherwise();
    for (const Side wheel : kSides) {
      Memory::Ticks& ticks = memory_.ticks[wheel];
      const sim::Quadrature& encoder = robot_.encoders[swapped ? other(wheel) : wheel];
      const int64_t moved = encoder.shown_ticks() - ticks.shown;
      ticks.shown = encoder.shown_ticks();
      if (!known || encoder.model.stuck != 0 || std::abs(moved) > kMostTicksInAStep) {
        ticks.known = ticks.countable = false;
        continue;
      }
      const bool inverted = (value(wheel == kLeft ? kLeftEncoderInverted : kRightEncoderInverted) !=
                             0) != encoder.model.reversed;
      ticks.expected += static_cast<uint32_t>(inverted ? -moved : moved);
    }
  }

  // --- flash ------------------------------------------------------------------------------------

  /// At the end of a control step: a tick that is undone before the next step is not seen.
  void follow_motion() {
    const bool is_seen = shows_wheels();
    for (const Side wheel : kSides) {
      const sim::Quadrature& encoder = robot_.encoders[wheel];
      const int64_t change = encoder.shown_ticks() - memory_.seen_ticks[wheel];
      const int64_t moved = std::abs(change);
      memory_.seen_ticks[wheel] = encoder.shown_ticks();
      if (hides_edges(encoder.model)) memory_.hid_edges_us[wheel] = now_us();
      const bool is_stuck = encoder.model.stuck != 0;
      const bool was_stuck = memory_.was_stuck[wheel];
      memory_.was_stuck[wheel] = is_stuck;
      if (moved != 0 || is_stuck || was_stuck) memory_.perhaps_ticked_us = now_us();
      if (is_stuck) memory_.hidden_ticks[wheel] = std::max(memory_.hidden_ticks[wheel], 1);
      if (world_.changed_encoders) memory_.hidden_ticks[wheel] = 2;
      Memory::Turning& turning = memory_.turning[wheel];
      if (is_stuck || was_stuck || !is_seen || world_.changed_encoders) turning = {};
      // In the step in which a level comes back the wheel may have moved before that alone.
      if (moved == 0 || is_stuck || was_stuck) continue;
      // The first edge after a level was stuck changes both at once, which a counter takes for
      // none. After another encoder was at its pins, two edges may lead it back to the levels that
      // it knew.
      const bool is_counted = moved > memory_.hidden_ticks[wheel];
      memory_.hidden_ticks[wheel] = 0;
      if (is_seen && is_counted) memory_.turned_us = memory_.ticked_us = now_us();
      const int way = change > 0 ? 1 : -1;
      const bool goes_on = way == turning.way && now_us() - turning.ticked_us < kSurelyTurnsUs;
      if (!is_seen || !is_counted || !goes_on) turning = {.way = way};
      turning.ticked_us = now_us();
      ++turning.steps;
    }
    // On a board that is wired otherwise, windings do what they do.
    if (is_driven() || is_driving()) memory_.drove_us = now_us();
  }

  void remember() {
    const bool drives = is_driving() && granted_;
    memory_.followed_duty = drives && granted_->duty;
    memory_.followed_velocity = drives && !granted_->duty;
    if (memory_.followed_velocity && commanded_umps() != 0.0) memory_.commanded_us = now_us();
    if (memory_.restarting_steps > 0) --memory_.restarting_steps;
    // When the bumper no longer holds it off, it starts again.
    memory_.was_held = witness_.perhaps_held_ways != 0;
    memory_.state = simulator_.state();
    for (const Side side : kSides) {
      memory_.duty[side] = duty(side);
      memory_.commanded_umps[side] = commanded_umps(side);
      memory_.directions[side] = direction_of(robot_.bridges()[side]);
    }
    follow(memory_.stood_since_us, robot_.plant.stands_still());
    memory_.faults = simulator_.faults();
    memory_.step_us = now_us();
    if (reads_encoders_otherwise()) memory_.turning = {};
    memory_.values = memory_.known_values = witness_.values();
    memory_.default_protection = has_default_protection();
    memory_.earlier_highest = memory_.highest;
    memory_.highest = memory_.values;
    memory_.hard_switches = robot_.hard_switches();
    world_.writes_flash = world_.handled = world_.changed_encoders = false;
  }

  bool surely_turns() const {
    return memory_.ticked_us != 0 && now_us() - memory_.ticked_us < kSurelyTurnsUs;
  }

  bool surely_still() const { return now_us() - memory_.perhaps_ticked_us > kSurelyStillUs; }
  bool has_changed(ParameterId id) const { return value(id) != before(id); }

  bool lasts(uint64_t since_us, uint64_t for_us) const {
    return since_us != 0 && now_us() > since_us + for_us;
  }

  uint64_t now_us() const { return robot_.device_us(); }
  uint64_t world_us() const { return static_cast<uint64_t>(robot_.now() / 1000); }
  double value(ParameterId id) const { return static_cast<double>(witness_.value(id)); }
  /// At the end of the last step.
  double before(ParameterId id) const { return static_cast<double>(memory_.values[index_of(id)]); }
  StopMode configured_stop() const { return static_cast<StopMode>(value(kStopMode)); }

  /// Each encoder shows the turns of a wheel of its own.
  bool shows_wheels() const {
    const auto& wiring = robot_.wiring;
    return world_.wired_as_believed && wiring.both_on == 0 && !wiring.mixed;
  }

  bool is_driven() const { return world_.wired_as_believed && robot_.drives(); }
  bool is_driving() const { return simulator_.state() == kDriving; }
  double duty(sim::Side side) const { return robot_.bridges()[side].signed_duty(); }
  double commanded_umps(sim::Side side) const { return simulator_.commanded_umps(side); }

  double speed_mps(sim::Side side) const { return std::abs(robot_.plant.speed_mps(side)); }

  /// Of the faster wheel.
  double speed_mps() const { return std::max(speed_mps(kLeft), speed_mps(kRight)); }

  double commanded_umps() const {
    return std::max(std::abs(commanded_umps(kLeft)), std::abs(commanded_umps(kRight)));
  }

  sim::Simulator& simulator_;
  const sim::SimulatedBoard& robot_;
  const Witness& witness_;
  const std::optional<Granted>& granted_ = witness_.granted;
  World& world_;
  Memory memory_;
  std::optional<Finding> finding_;
};

}  // namespace wheelwire::explore
