// The rules of docs/safety.md, each by its code. They look at the robot from outside: at windings,
// wheels, bytes and time.
#pragma once

#include <array>
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
  /// `excepted`: rules that are not looked at, as bits.
  Judge(sim::Simulator& simulator, const Witness& witness, World& world, uint64_t excepted)
      : simulator_(simulator), witness_(witness), world_(world), excepted_(excepted) {}

  /// The first thing that is wrong, if any.
  const std::optional<Finding>& finding() const { return finding_; }
  void accuse(const Finding& finding) {
    const bool excepted = (excepted_ >> static_cast<unsigned>(finding.rule) & 1) != 0;
    if (!finding.text.empty() && !excepted && !finding_) finding_ = finding;
  }

  void before_message() {
    time_moves_the_state();
    follow_transition();
  }
  void after_message();
  /// `stepped`: a control step has ended; otherwise the firmware only read the line.
  void after_call(bool stepped);
  void after_start();
  void on_state(const WheelState& state);
  void on_event(const Event& event);
  /// The firmware writes to flash without a request. `creeping`: also while it creeps on the brake
  /// of an e-stop.
  void flash_only_at_rest(bool creeping);

 private:
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

  void drive_only_in_driving();
  void contact_stops();
  void deadline_stops();
  void driven_by_right();
  void confirmed_board_only();
  void wheel_fault_in_time();
  void driven_hard_without_a_tick();
  void sound_robot_drives_on();
  void time_moves_the_state();
  void message_moves_the_state();
  void stop_at_once();
  void board_stays_while_estopped();
  void values_change_at_rest();
  void slew_within_limit();
  void begins_gently();
  void within_limits();
  void no_hard_switch();
  void pauses_for_a_period();
  void values_are_as_acknowledged();
  void contradictions_never_drive();
  void late_step_is_a_fault();
  void not_against_a_bumper();
  bool is_to_stand();
  void external_stops();
  void half_of_the_speed();
  void lost_copy_is_repaired();
  void not_too_fast();
  void estop_is_noted();
  void follow_message();
  void follow_transition();
  void follow_step();
  void begin_action(StopMode mode, bool certain, bool weakens = false, uint64_t since_us = 0);
  void begin_estop(bool certain, uint64_t since_us = 0);
  void begin_fault(uint32_t new_faults);
  void stops_as_asked();
  bool surely_turns() const {
    return memory_.ticked_us != 0 && now_us() - memory_.ticked_us < kSurelyTurnsUs;
  }
  bool surely_turns(sim::Side wheel) const;
  bool surely_still() const { return now_us() - memory_.perhaps_ticked_us > kSurelyStillUs; }
  double highest(ParameterId id) const;
  double highest_of_two_steps(ParameterId id) const;
  bool has_changed(ParameterId id) const { return value(id) != before(id); }
  void follow(uint64_t& since_us, bool holds) const;
  bool lasts(uint64_t since_us, uint64_t for_us) const {
    return since_us != 0 && now_us() > since_us + for_us;
  }
  bool is_shorted() const;
  bool creeps(double share) const;
  bool moves_slower_than(ParameterId limit) const;
  void rolling_is_reported();
  void follow_ticks();
  void follow_motion();
  void remember();

  double target(sim::Side side) const;
  bool is_wrong(sim::Side side) const;
  bool has_default_protection() const;
  bool reads_encoders_otherwise() const;
  bool is_clean() const;
  /// Whether a bumper keeps a robot in DRIVING from what its setpoint says, by flags of `reflex`.
  bool is_held_by_a_bumper(uint32_t ways) const;
  uint64_t now_us() const { return simulator_.board.device_us(); }
  uint64_t world_us() const { return static_cast<uint64_t>(simulator_.board.now() / 1000); }
  double value(ParameterId id) const { return static_cast<double>(witness_.value(id)); }
  /// At the end of the last step.
  double before(ParameterId id) const { return static_cast<double>(memory_.values[index_of(id)]); }
  StopMode configured_stop() const { return static_cast<StopMode>(value(kStopMode)); }
  bool is_default(ParameterId id) const;
  /// The firmware knows how many ticks a turn has.
  bool counts_right() const;
  bool measures_right() const;
  bool is_monitored() const;
  /// Each encoder shows the turns of a wheel of its own.
  bool shows_wheels() const {
    const auto& wiring = simulator_.board.wiring;
    return world_.wired_as_believed && wiring.both_on == 0 && !wiring.mixed;
  }
  bool is_driving() const { return simulator_.state() == SupervisorState::kDriving; }
  double duty(sim::Side side) const { return simulator_.board.bridges()[side].signed_duty(); }
  double commanded_umps(sim::Side side) const { return simulator_.commanded_umps(side); }
  double speed_mps(sim::Side side) const {
    return std::abs(simulator_.board.plant.speed_mps(side));
  }
  /// Of the faster wheel.
  double speed_mps() const { return std::max(speed_mps(sim::kLeft), speed_mps(sim::kRight)); }
  double commanded_umps() const {
    return std::max(std::abs(commanded_umps(sim::kLeft)), std::abs(commanded_umps(sim::kRight)));
  }

  sim::Simulator& simulator_;
  const Witness& witness_;
  World& world_;
  uint64_t excepted_;
  Memory memory_;
  std::optional<Finding> finding_;
};

}  // namespace wheelwire::explore
