// Generates a scenario from a seed.
#pragma once

#include <array>
#include <cmath>
#include <initializer_list>

#include "operation.hpp"
#include "peripheral_lists.hpp"
#include "random.hpp"
#include "shipped_boards.hpp"

namespace wheelwire::explore {

/// What a scenario is mostly about. All of them meet hosts, stops, resets and a bad line.
enum class Subject { kSound, kDefects, kParameters, kBoards, kFlash, kAnything, kCount };

/// Values of parameters that exclude each other, by chance from an interval of each.
struct Interval {
  ParameterId id{};
  double low = 0.0;
  double high = 0.0;  ///< 0: one parameter alone contradicts.
};

constexpr std::array<Interval, 2> kContradicting[] = {
    {{{kOverrunLimitUs, 2000, 8000}, {kControlRateHz, 100, 300}}},
    {{{kStreamRateHz, 900, 1500}}},
    {{{kSupplyDropV, 5, 8}}},
    {{{kCountsPerRevolution, 200e3, 200e3}, {kMaxVelocityMps, 5, 10}}},
    {{{kGlitchFilterNs, 12'000, 12'000}, {kCountsPerRevolution, 20e3, 60e3}}},
    {{{kPwmFrequencyHz, 19e3, 40e3}}},
};

/// The same seed gives the same scenario, on every machine.
class Generator {
 public:
  explicit Generator(uint64_t seed) : random_(seed) { scenario_.seed = seed; }

  Scenario scenario() {
    subject_ = static_cast<Subject>(below(static_cast<size_t>(Subject::kCount)));
    set_up();
    // On its own board, which measures its battery.
    if (chance(15)) peripherals(static_cast<size_t>(one_of({kBatteryList, kBatteryList, 6, 7})));
    const size_t phases = 6 + below(18);
    for (size_t i = 0; i < phases; ++i) phase();
    add("run"_op, {2e6});
    return scenario_;
  }

 private:
  // --- chance ------------------------------------------------------------------------------------

  size_t below(size_t count) { return static_cast<size_t>(random_.next() % count); }
  bool chance(int percent) { return below(100) < static_cast<size_t>(percent); }
  double unit() { return (sim::symmetric(random_.next()) + 1.0) / 2.0; }
  double between(double low, double high) { return low + (high - low) * unit(); }
  /// Each decade is as likely as the others.
  double spread(double low, double high) { return low * std::pow(high / low, unit()); }
  double one_of(std::initializer_list<double> values) {
    return values.begin()[below(values.size())];
  }
  double index(size_t count) { return static_cast<double>(below(count)); }
  double side() { return index(2); }
  /// Does one of these, each as often.
  template <typename... Choices>
  void choose(Choices... choices) {
    const size_t chosen = below(sizeof...(choices));
    size_t i = 0;
    ((i++ == chosen ? choices() : void()), ...);
  }
  bool is_about(Subject subject) const {
    return subject_ == subject || subject_ == Subject::kAnything;
  }

  void add(Kind kind, std::initializer_list<double> values = {}) {
    scenario_.operations.push_back(make(kind, values));
    if (kind == "open"_op) host_ = scenario_.operations.back().values[0];
  }
  /// A program that connects, or seldom a library that reconnects by itself.
  void open() { add("open"_op, {0, chance(15) ? 1.0 : 0.0}); }
  void wait() { add("run"_op, {std::floor(chance(60) ? spread(200, 20e3) : spread(20e3, 3e6))}); }
  void moment() {
    if (chance(20)) return add("service"_op);
    if (chance(70)) add("run"_op, {std::floor(spread(100, 5e3))});
  }

  // --- the robot ---------------------------------------------------------------------------------

  void set_up() {
    if (is_about(Subject::kBoards) && chance(70)) {
      add("wire"_op, {chance(30) ? -1.0 : index(std::size(sim::kShippedBoards)),
                      chance(60) ? 1.0 : 0.0, side()});
    }
    if (chance(20)) add("boot_time"_op, {std::floor(spread(100, 500e3))});
    if (chance(15)) add("baud"_op, {one_of({115'200, 230'400, 921'600, 2e6})});
    if (chance(15)) add("clock"_op, {between(-200, 200)});
    if (is_about(Subject::kDefects) && chance(60)) {
      const double volts = between(4.8, 12.6);
      add("supply"_op, {volts, chance(20) ? between(0, 2) : 0.0, chance(15) ? 4.5 : 0.0});
      add("battery"_op, {chance(30) ? 0.0 : volts});
    }
    if (subject_ == Subject::kAnything && chance(30))
      add("counts"_op, {std::floor(spread(20, 100e3))});
    add("run"_op, {60e3});
    if (chance(90)) open();
  }

  void defect() {
    choose([&] { add("encoder"_op, {side(), 1}); }, [&] { add("encoder"_op, {side(), 0, 1}); },
           [&] { add("encoder"_op, {side(), 0, 0, 1.0 + side()}); },
           [&] { add("lost_edges"_op, {side(), between(0, 0.9), between(0, 0.4)}); },
           [&] { add("motor"_op, {side(), 1}); }, [&] { add("motor"_op, {side(), 0, 1}); },
           [&] { add("blocked"_op, {side(), 1}); }, [&] { add("swaps"_op, {side(), side()}); });
  }

  void repair() {
    for (const double wheel : {0.0, 1.0})
      for (const Kind kind : {"encoder"_op, "motor"_op, "blocked"_op, "lost_edges"_op})
        add(kind, {wheel});
  }

  // --- driving -----------------------------------------------------------------------------------

  /// The host with the session, if that has not ended; sometimes the other host.
  double host() { return chance(92) ? host_ : 1.0 - host_; }

  double speed() {
    if (chance(3))
      return one_of({kNan, std::numeric_limits<double>::infinity(), 3e38, -3e38, 1e-7});
    const double magnitude = chance(20) ? one_of({0.02, 0.1, 0.4, 1.0, 10.0}) : spread(0.02, 0.6);
    return chance(30) ? -magnitude : magnitude;
  }

  /// Drives for a while; mostly both wheels alike.
  void drive(double for_us) {
    const bool duty = chance(20);
    const double left = duty ? between(-1, 1) : speed();
    const double right = chance(60) ? left : duty ? between(-1, 1) : speed();
    const double every_us = chance(80) ? 50e3 : std::floor(spread(2e3, 900e3));
    add("hold"_op, {host(), left, right, for_us, every_us, duty ? 1.0 : 0.0});
  }

  void setpoint(double who) {
    const double life_us =
        chance(80) ? std::floor(spread(20e3, 2e6)) : std::floor(between(-1e5, 8e6));
    const double ahead = chance(90) ? 1.0 : one_of({0, -1, -5, 3, 1000});
    const double session = chance(95) ? 0.0 : 1.0 + side();
    if (chance(25))
      return add("duty"_op, {who, between(-1, 1), between(-1, 1), life_us, ahead, session});
    const double left = chance(10) ? 0.0 : speed();
    add("velocity"_op, {who, left, chance(60) ? left : speed(), life_us, ahead, session});
  }

  void rest() { add("velocity"_op, {host_, 0, 0, 200e3, 1, 0}); }

  void drive_on() {
    rest();
    drive(std::floor(spread(50e3, 600e3)));
  }

  /// What follows needs a robot that can drive: mostly it is one.
  void make_ready() {
    if (chance(30)) return;
    add("contact"_op, {0});
    if (chance(50)) add("open"_op, {0});
    add("clear_estop"_op, {host_, 1});
    add("clear_fault"_op, {host_, 1});
    rest();
    add("run"_op, {3e3});
    add("stop"_op, {host_, 0, 1});
  }

  /// A stop, and at once the other way: read in one call, or before the next step.
  void turn_round() {
    const bool duty = chance(50);
    const double speed = duty ? between(0.05, 0.6) : spread(0.05, 0.5);
    add("hold"_op, {host_, speed, speed, std::floor(spread(50e3, 600e3)), 50e3, duty ? 1.0 : 0.0});
    for (size_t i = 1 + below(2); i > 0; --i) {
      add("stop"_op, {host_, index(4), 1});
      if (chance(30)) moment();
      add(chance(70) ? "duty"_op : "velocity"_op, {host_, -speed, -speed, 300e3, 1, 0});
      if (chance(30)) moment();
    }
    wait();
  }

  /// Something ends, or disturbs, the drive.
  void interrupt() {
    if (chance(5)) return turn_round();
    const auto stop = [&] { add("stop"_op, {host(), index(5), 1}); };
    const auto open_contact = [&] { contact(); };
    choose(
        stop, stop, [&] { add("estop"_op, {host()}); }, open_contact, open_contact,
        [&] { add("open"_op, {side()}); }, [&] { reset(); }, [&] { late(); },
        [&] { add("run"_op, {std::floor(spread(100e3, 4e6))}); },
        [&] { add("hello"_op, {host(), side()}); }, [&] { parameter(true); },
        [&] { setpoint(host()); });
  }

  void late() {
    const double us = std::floor(spread(500, 60e3));
    add("late"_op, {us});
    if (chance(60)) add("run"_op, {us + 5e3});
  }

  void contact() {
    add("contact"_op, {1});
    if (chance(25)) return bounce();
    if (chance(50)) {
      add("run"_op, {std::floor(spread(100, 2e6))});
      if (chance(40)) add("clear_estop"_op, {host_, 1});
      if (chance(30)) setpoint(host_);
      add("contact"_op, {0});
    }
  }

  /// It is closed between two steps only, in which somebody clears.
  void bounce() {
    add("run"_op, {std::floor(spread(1e3, 50e3))});
    add("contact"_op, {0});
    add("clear_estop"_op, {host_, 1});
    add("service"_op);
    add("contact"_op, {1});
    add("run"_op, {std::floor(spread(500, 20e3))});
    if (chance(80)) add("contact"_op, {0});
  }

  void reset() {
    add("reset"_op, {one_of({1, 2, 3, 4, 5, 6, 7})});
    if (chance(80)) {
      add("run"_op, {chance(80) ? 60e3 : 5e3});
      if (chance(85)) open();
    }
  }

  /// A library that reconnects long after the start, while its program published all the time.
  void come_back_late() {
    add("reset"_op, {one_of({1, 2, 3, 4, 5, 6, 7})});
    add("run"_op, {std::floor(spread(500e3, 5e6))});
    add("open"_op, {0, 1});
    drive(std::floor(spread(20e3, 900e3)));
  }

  /// Ends what is latched, and drives on in a way that it may or may not.
  void clear() {
    if (chance(80)) add("contact"_op, {0});
    const bool estop = chance(70);
    if (estop) {
      add("clear_estop"_op, {host(), 1});
      moment();
    }
    if (!estop || chance(50)) {
      add("clear_fault"_op, {host_, 1});
      moment();
    }
    if (chance(35)) persist();
    if (chance(30)) rest();
    if (chance(20)) add("run"_op, {std::floor(spread(100e3, 1.5e6))});
    if (chance(10)) add("repeat"_op, {host_, index(4)});
    if (chance(60)) {
      setpoint(host_);
      wait();
    }
    if (chance(60)) {
      rest();
      drive(std::floor(spread(100e3, 2e6)));
    }
  }

  /// A program that does not pause after a clear, whatever the reason for the refusals.
  void persist() {
    const size_t wrong = below(5);
    const double every_us = std::floor(spread(20e3, 400e3));
    const double life_us = wrong == 0 ? 0 : 500e3;
    const double speed_mps = wrong == 1 ? kNan : 0.2;
    const double session = wrong == 2 ? 2 : 0;
    if (wrong == 3) {
      add("hello"_op, {host_, 1});
      add("run"_op, {3e3});
    }
    for (size_t i = 2 + below(12); i > 0; --i) {
      add("velocity"_op, {host_, speed_mps, speed_mps, life_us, 1, session});
      add("run"_op, {every_us});
    }
    if (wrong == 3) {
      add("ping"_op, {host_, 0});
      add("run"_op, {3e3});
    }
    add("velocity"_op, {host_, 0.2, 0.2, 500e3, 1, 0});
    moment();
  }

  // --- parameters --------------------------------------------------------------------------------

  double value_of(const ParameterSpec& spec) {
    const auto low = static_cast<double>(spec.minimum);
    const auto high = static_cast<double>(spec.maximum);
    const auto usual = static_cast<double>(spec.default_value);
    const size_t how = below(10);
    if (how == 7 && !chance(70))
      return one_of(
          {high * 1.1 + 1, low - 1, usual + 0.5, kNan, -std::numeric_limits<double>::infinity()});
    double value = usual;
    if (how == 0) value = low;
    if (how == 1) value = high;
    if (how >= 2 && how <= 5)
      value = how >= 4 && low > 0.0 ? spread(low, high) : between(low, high);
    if (how == 6) value = usual * between(0.3, 1.7);
    value = std::fmin(std::fmax(value, low), high);
    return spec.kind == ParameterKind::kReal ? value : std::round(value);
  }

  void parameter(bool always = false) {
    const ParameterSpec* spec = &kParameters[below(kParameterCount)];
    for (int i = 0; always && i < 20 && spec->changes != ParameterChanges::kAlways; ++i)
      spec = &kParameters[below(kParameterCount)];
    const double id = chance(98) ? static_cast<double>(spec->id) : one_of({0, 44, 60, 255});
    add("set"_op, {host(), id, value_of(*spec), 1, 0});
  }

  /// Somebody tunes the robot while it drives: limits and gains at their ends, several at once.
  void tune() {
    constexpr ParameterId kTuned[] = {
        kMaxVelocityMps, kMaxAccelerationMps2, kMaxDuty,          kMaxDutyRatePerS, kPathGain,
        kHeadingGain,    kPathCatchUp,         kProportionalGain, kIntegralGain};
    make_ready();
    drive(std::floor(spread(50e3, 1e6)));
    const double mostly = one_of({0.0, 0.0, 1.0, 0.5});
    for (size_t i = 1 + below(4); i > 0; --i) {
      const ParameterSpec& spec =
          kParameters[static_cast<size_t>(kTuned[below(std::size(kTuned))]) - 1];
      const auto low = static_cast<double>(spec.minimum);
      const double part = chance(70) ? mostly : unit();
      add("set"_op, {host_, static_cast<double>(spec.id),
                     low + part * (static_cast<double>(spec.maximum) - low), 1, 0});
      if (chance(40)) moment();
    }
    drive(std::floor(spread(20e3, 1e6)));
  }

  void set(ParameterId id, double value) {
    add("set"_op, {host_, static_cast<double>(id), value, 1, 0});
    moment();
  }

  void parameters() {
    for (size_t i = 1 + below(4); i > 0; --i) {
      parameter();
      moment();
    }
    if (chance(40)) add("save"_op, {host_, chance(50) ? 0.0 : index(kParameterCount + 3)});
    if (chance(10)) add("reset_parameters"_op, {host_});
  }

  void trial() {
    make_ready();
    add("trial"_op, {host_, 1, chance(90) ? spread(0.2, 3) : one_of({0.1, 70, -1})});
    moment();
    for (size_t i = 1 + below(3); i > 0; --i) {
      parameter(chance(50));
      moment();
    }
    if (chance(50)) set(kStopMode, 1.0 + index(3));
    if (chance(80)) drive(std::floor(spread(50e3, 1e6)));
    if (chance(20)) add("trial"_op, {host_, 2, spread(0.2, 3)});
    const auto reopen = [&] { add("open"_op, {side()}); };
    choose([&] { add("trial"_op, {host_, 3}); }, [&] { add("trial"_op, {host_, 4}); }, reopen,
           reopen, [&] { add("run"_op, {4e6}); }, [&] { reset(); }, [&] { interrupt(); });
    moment();
    if (chance(50)) add("trial"_op, {host_, 4});
    drive(std::floor(spread(50e3, 600e3)));
  }

  /// Values that exclude each other: one by one, on trial, or saved and then met by another board.
  void contradict() {
    const bool tries = chance(60);
    if (tries) add("trial"_op, {host_, 1, 20});
    moment();
    for (const Interval& of : kContradicting[below(std::size(kContradicting))]) {
      if (of.high == 0.0) continue;
      const double value = of.low == of.high ? of.low : between(of.low, of.high);
      const bool is_real = kParameters[static_cast<size_t>(of.id) - 1].kind == ParameterKind::kReal;
      set(of.id, is_real ? value : std::floor(value));
    }
    if (tries && chance(40)) add("trial"_op, {host_, 3});
    moment();
    drive(std::floor(spread(20e3, 300e3)));
    if (chance(50)) add("stop"_op, {host_, 0, 1});
    if (chance(50)) add("save"_op, {host_, 0});
    if (chance(30)) {
      moment();
      board();
    }
  }

  // --- boards ------------------------------------------------------------------------------------

  /// The robot restarts with this board, as a rule: -1 is its own.
  void configure(double board, size_t list) {
    list_ = list;
    add("configure"_op,
        {host_, board, static_cast<double>(list), chance(85) ? 0.0 : 1.0 + index(4)});
    moment();
    if (chance(10)) add("open"_op, {side()});
    if (chance(85)) add("restart"_op, {host_});
    add("run"_op, {chance(80) ? 130e3 : std::floor(spread(1e3, 100e3))});
  }

  void board() {
    const auto which = index(std::size(sim::kShippedBoards));
    const bool contact = chance(25);
    if (contact) {
      add(chance(50) ? "contact"_op : "estop"_op, {chance(50) ? 1.0 : 0.0});
      moment();
    }
    configure(which, below(kLists));
    if (chance(20)) reset();
    if (chance(90)) open();
    if (chance(40)) setpoint(host_);
    if (chance(25)) contact_or_estop();
    if (chance(15)) add("run"_op, {11e6});
    if (chance(80)) add("confirm"_op, {host_, chance(90) ? 0.0 : 1.0});
    moment();
    if (chance(30)) add("run"_op, {130e3});
    if (chance(40)) add("open"_op, {0});
    drive(std::floor(spread(50e3, 1e6)));
  }

  /// The contact is switched off and saved, and the robot moves to a board that has one as well.
  void contact_of_another_board() {
    make_ready();
    set(kEstopInputEnabled, 0);
    add("save"_op, {host_, 0});
    moment();
    board();
    reset();
  }

  // --- sensors -----------------------------------------------------------------------------------

  /// Usually a sensor of the robot's list.
  double sensed() {
    if (chance(20)) return index(static_cast<size_t>(Sensed::kCount));
    using enum Sensed;
    constexpr std::array<Sensed, 2> kOf[kLists] = {
        {kFrontLeft, kFrontRight}, {kFrontLeft, kRear},       {kCliff, kStageFault},
        {kFrontLeft, kFrontRight}, {kFrontLeft, kCliff},      {kFrontRight, kStageFault},
        {kRear, kCliff},           {kFrontLeft, kStageFault},
    };
    return static_cast<double>(kOf[list_][chance(50) ? 0 : 1]);
  }

  double volts() {
    return one_of({kWarnMv + 300.0, kWarnMv + 100.0, kLimitMv + 100.0, kStopMv + 100.0,
                   kStopMv - 100.0, kStopMv - 100.0, 0.0}) /
           1000.0;
  }

  /// At more than half of the speed.
  void hurry(double for_us) {
    const double left = one_of({0.25, 0.3, 0.4, -0.4});
    const double right = chance(60) ? left : one_of({0.1, 0.2, 0.4, -0.3});
    add("hold"_op, {host_, left, right, for_us, 50e3, 0});
  }

  void run_for(double low_us, double high_us) {
    add("run"_op, {std::floor(between(low_us, high_us))});
  }
  void measure(double millivolts) { add("battery"_op, {millivolts / 1000.0}); }

  /// Mostly until its level has fallen.
  void empty(double millivolts) {
    measure(millivolts);
    hurry(std::floor(between(1.8e6, 2.8e6)));
  }

  /// A dip below the lowest bound amid a longer one below a higher.
  void dip() {
    measure(kWarnMv + 300.0);
    hurry(200e3);
    measure(one_of({kLimitMv + 100.0, kStopMv + 100.0}));
    hurry(std::floor(between(1.5e6, 2.3e6)));
    measure(kStopMv - 100.0);
    hurry(std::floor(spread(20e3, 600e3)));
    measure(one_of({kWarnMv + 300.0, kWarnMv + 100.0, kStopMv + 100.0}));
    hurry(std::floor(between(100e3, 3e6)));
  }
  /// It is charged, and its voltage trembles around where a warning ends.
  void tremble() {
    empty(kLimitMv - 100.0);
    for (size_t i = 0; i < 7; ++i) {
      measure(i % 2 == 0 ? kWarnMv + 300.0 : kWarnMv + 200.0);
      run_for(1e6, 2.5e6);
    }
    drive(std::floor(spread(50e3, 600e3)));
  }
  /// The wire of its divider breaks while it is charged.
  void fall_silent() {
    empty(kStopMv - 100.0);
    measure(kWarnMv + 300.0);
    run_for(500e3, 6e6);
    measure(0.0);
    run_for(50e3, 9e6);
    measure(kWarnMv + 300.0);
    run_for(50e3, 9e6);
    add("clear_fault"_op, {host_, 1});
    drive_on();
  }
  /// A reset with an empty battery whose voltage has recovered without its load.
  void restart_empty() {
    empty(kStopMv - 100.0);
    measure(one_of({kStopMv + 100.0, kWarnMv + 100.0, kWarnMv + 300.0, 0.0}));
    if (chance(80)) reset();
    add("open"_op, {host_});
    if (chance(50)) add("clear_fault"_op, {host_, 1});
    run_for(10e3, 2e6);
    add("clear_fault"_op, {host_, 1});
    drive_on();
  }

  void what_batteries_do() {
    const auto nothing = [] {};
    choose([&] { dip(); }, [&] { tremble(); }, [&] { fall_silent(); }, [&] { restart_empty(); },
           nothing, nothing, nothing, nothing);
  }

  /// The battery empties while it drives, and is charged.
  void drain() {
    if (chance(70)) make_ready();
    for (size_t i = 2 + below(4); i > 0; --i) {
      add("battery"_op, {volts()});
      // A level falls after two seconds and rises after ten.
      if (chance(30))
        add("run"_op, {std::floor(chance(50) ? between(9.5e6, 11e6) : spread(10e3, 9e6))});
      else if (chance(60))
        hurry(std::floor(between(1.8e6, 3.5e6)));
      else
        drive(std::floor(spread(50e3, 3.5e6)));
      if (chance(15)) interrupt();
      what_batteries_do();
      if (chance(30)) add("clear_fault"_op, {host_, 1});
      if (chance(20)) setpoint(host_);
    }
    if (chance(70)) add("battery"_op, {7.4});
    if (chance(60)) add("run"_op, {std::floor(spread(9e6, 12e6))});
    if (chance(70)) add("clear_fault"_op, {host_, 1});
    drive_on();
  }

  /// It stands on a slope, and its program drives on; most often by a setpoint of zero.
  void roll() {
    add("slope"_op, {one_of({-0.4, -0.3, 0.3, 0.4})});
    // An open loop is held off a bumper only where it is driven towards it.
    const bool duty = chance(40);
    const double speed = duty ? one_of({0.2, -0.2}) : one_of({0, 0, 0.2, -0.2});
    add("hold"_op, {host_, speed, speed, 4e6, 50e3, duty ? 1.0 : 0.0});
    if (chance(80)) add("slope"_op, {0});
  }

  /// Something triggers while it drives, and perhaps it backs out.
  void bump() {
    if (list_ == kBatteryList || (has_levels(kListed[list_]) && chance(50))) return drain();
    const double which = sensed();
    if (chance(70)) make_ready();
    if (chance(80)) drive(std::floor(spread(20e3, 1e6)));
    add("sensor"_op, {which, 1});
    if (subject_ != Subject::kSound && chance(30)) roll();
    for (size_t i = 1 + below(3); i > 0; --i) {
      if (chance(30)) {
        setpoint(host_);
        wait();
      } else {
        drive(std::floor(spread(10e3, 600e3)));
      }
      if (chance(15)) interrupt();
      if (chance(15)) add("sensor"_op, {sensed(), side()});
      if (chance(20)) add("clear_fault"_op, {host_, 1});
    }
    if (chance(85)) add("sensor"_op, {which, 0});
    if (chance(30)) add("run"_op, {std::floor(spread(1e3, 200e3))});
    if (chance(60)) add("clear_fault"_op, {host_, 1});
    drive_on();
  }

  /// Other peripherals on the same board.
  void peripherals(size_t list) {
    if (chance(20)) contact_or_estop();
    configure(-1, list);
    if (chance(15)) reset();
    if (chance(90)) open();
    if (chance(30)) setpoint(host_);
    if (chance(10)) add("run"_op, {11e6});
    if (chance(85)) add("confirm"_op, {host_, chance(90) ? 0.0 : 1.0});
    moment();
    if (chance(60)) add("sensor_stream"_op, {host_, one_of({0, 10, 200, 1000})});
    bump();
    if (chance(25)) board();
  }

  void contact_or_estop() {
    if (chance(50)) return add("estop"_op, {host()});
    add("contact"_op, {1});
    moment();
  }

  void confirm() {
    setpoint(host_);
    moment();
    add("confirm"_op, {host_, chance(85) ? 0.0 : 1.0});
    if (chance(30)) setpoint(host_);
    add("run"_op, {130e3});
    add("open"_op, {0});
    drive(std::floor(spread(50e3, 800e3)));
  }

  // --- flash -------------------------------------------------------------------------------------

  void flash() {
    if (chance(50)) fill_flash();
    if (chance(70)) add("power_cut"_op, {index(7), index(3)});
    if (chance(20)) add("store_fails"_op, {index(3), side()});
    switch (below(6)) {
      case 5:
        return damage();
      case 4:
        peripherals(below(kLists));
        break;
      case 0:
        parameters();
        add("save"_op, {host_, 0});
        break;
      case 1:
        board();
        break;
      case 2:
        contact_or_estop();
        add("run"_op, {std::floor(spread(100e3, 14e6))});
        if (chance(50)) {
          add("contact"_op, {0});
          add("clear_estop"_op, {host_, 1});
          add("run"_op, {std::floor(spread(1e3, 3e6))});
        }
        break;
      default:
        add("reset_parameters"_op, {host_});
        if (chance(30)) damaged_flash();
    }
    wait();
    reset();
    if (chance(30)) add("store_fails"_op, {index(3), 0});
  }

  /// Each block was saved.
  void fill_flash() {
    if (chance(70)) add("stop"_op, {host_, 0, 1});
    set(kBrakeTimeS, between(0.1, 2));
    add("save"_op, {host_, 0});
    moment();
    if (chance(50)) return;
    add("estop"_op, {host_});
    add("run"_op, {std::floor(spread(1e6, 14e6))});
    if (chance(70)) add("clear_estop"_op, {host_, 1});
    add("run"_op, {std::floor(spread(1e3, 3e6))});
  }

  /// One slot of a block is damaged, or both; perhaps the robot rests for long enough to repair it,
  /// or somebody does what the fault's text says.
  void damage() {
    if (chance(70)) make_ready();
    if (chance(60)) fill_flash();
    if (chance(60)) chance(40) ? board() : peripherals(below(kLists));
    add("stop"_op, {host_, 0, 1});
    for (size_t i = 1 + below(3); i > 0; --i) {
      const double block = one_of({0, 0, 1, 1, 2});
      add("damage"_op, {block, index(3)});
      add("run"_op, {60e3});
      add("open"_op, {0});
      if (chance(20)) setpoint(host_);
      if (chance(40)) add("run"_op, {std::floor(spread(1e6, 4e6))});
      if (chance(60)) mend(block);
      if (chance(70)) reset();
    }
    add("open"_op, {0});
    make_ready();
    drive(std::floor(spread(50e3, 600e3)));
  }

  void mend(double block) {
    if (block == 2.0) return add("clear_estop"_op, {host_, 1});
    if (block == 1.0) {
      add(chance(50) ? "reset_parameters"_op : "save"_op, {host_, 0});
      moment();
      return add("clear_fault"_op, {host_, 1});
    }
    add("configure"_op, {host_, one_of({-1, 0, 1, 3}), index(kLists), 0});
    moment();
    if (chance(40)) add("restart"_op, {host_});
    add("run"_op, {130e3});
    if (chance(20)) add("run"_op, {11e6});
    if (chance(30)) {
      add("open"_op, {0});
      add("confirm"_op, {host_, 0});
      moment();
    }
  }

  /// The cure that the fault's text proposes, and what the device is then.
  void damaged_flash() {
    add("store_unreadable"_op, {one_of({256, 512, 1024}), index(3)});
    add("run"_op, {60e3});
    add("open"_op, {0});
    add("clear_estop"_op, {host_, 1});
    moment();
    if (chance(80)) add("reset_parameters"_op, {host_});
    moment();
    add("clear_fault"_op, {host_, 1});
    if (chance(40)) add("restart"_op, {host_});
    add("run"_op, {130e3});
    if (chance(30)) reset();
    add("open"_op, {0});
    if (chance(70)) add("clear_fault"_op, {host_, 1});
    rest();
    drive(300e3);
  }

  // --- wheels ------------------------------------------------------------------------------------

  void wheels() {
    if (chance(40)) set(kMaxDuty, chance(30) ? 1.0 : between(0.15, 1.0));
    if (chance(15)) repair();
    defect();
    if (chance(80)) add("run"_op, {4e6});
    if (chance(80)) {
      add("clear_fault"_op, {host_, 1});
      add("run"_op, {600e3});
    }
    if (chance(40)) return burst();
    const double velocity = chance(50) ? spread(0.02, 0.1) : spread(0.1, 0.4);
    const double left = chance(50) ? velocity : -velocity;
    const double right = chance(70) ? left : chance(50) ? -left : 0.0;
    add("hold"_op, {host_, left, right, std::floor(between(1e6, 4e6)), 100e3, 0});
    if (chance(60)) repair();
  }

  /// Drives that are too short for what watches a wheel to be sure, with stops between them.
  void burst() {
    const double speed = one_of({0.2, 0.3, 0.4, -0.3});
    const bool duty = chance(20);
    const double for_us = std::floor(spread(100e3, 450e3));
    const double pause_us = std::floor(spread(20e3, 1e6));
    const size_t how = below(3);
    for (size_t i = 6 + below(10); i > 0; --i) {
      add("hold"_op, {host_, duty ? 2.0 * speed : speed, duty ? 2.0 * speed : speed, for_us, 50e3,
                      duty ? 1.0 : 0.0});
      if (how == 0) add("stop"_op, {host_, index(4), 1});
      if (how == 1) add("hold"_op, {host_, 0, 0, pause_us, 50e3, 0});
      if (how != 1) add("run"_op, {pause_us});
    }
    if (chance(60)) repair();
  }
  /// Downhill, with less duty than it takes to hold the robot.
  void run_away() {
    repair();
    set(kMaxDuty, between(0.15, 0.4));
    set(kMaxVelocityMps, between(0.03, 0.12));
    const double rad = one_of({-0.4, -0.3, 0.3, 0.4});
    make_ready();
    add("slope"_op, {rad});
    const double speed = rad < 0.0 ? 0.1 : -0.1;
    for (size_t i = 1 + below(3); i > 0; --i) {
      add("hold"_op, {host_, speed, speed, std::floor(between(500e3, 4e6)), 50e3, 0});
      if (chance(50)) add("stop"_op, {host_, 0, 1});
    }
    add("run"_op, {std::floor(spread(100e3, 3e6))});
    add("slope"_op, {0});
  }

  /// An e-stop on a slope that its brake does not quite hold.
  void creep() {
    repair();
    make_ready();
    set(kRollingVelocityMps, between(0.5, 1));
    add("slope"_op, {one_of({-1, 1}) * between(0.05, 0.12)});
    if (chance(50)) drive(std::floor(spread(50e3, 500e3)));
    add("estop"_op, {host_});
    add("run"_op, {std::floor(between(14e6, 17e6))});
    if (chance(50)) reset();
    add("slope"_op, {0});
  }

  /// An encoder loses its edges in short gaps.
  void lose_in_gaps() {
    make_ready();
    const double of_us = std::floor(spread(5e3, 60e3));
    add("run"_op, {4e6});
    add("clear_fault"_op, {host_, 1});
    rest();
    add("gaps"_op, {host_, one_of({0.1, 0.2, 0.3, -0.3, 0.4}), std::floor(between(1e6, 8e6)),
                    side(), std::floor(of_us * one_of({0.5, 0.7, 0.75, 0.9})), of_us});
  }

  void floor() {
    choose([&] { add("slope"_op, {between(-0.35, 0.35)}); },
           [&] { add("load"_op, {side(), between(-0.05, 0.05)}); },
           [&] { add("push"_op, {side(), between(-3, 3)}); }, [&] { add("free"_op, {side()}); },
           [&] { add("slope"_op, {0}); });
    if (chance(20)) return burst();
    if (chance(15)) return run_away();
    if (chance(10)) return creep();
    if (chance(30)) set(kStopMode, 1.0 + index(3));
    drive(std::floor(spread(200e3, 3e6)));
    if (chance(50)) add("stop"_op, {host_, index(5), 1});
    add("run"_op, {std::floor(spread(100e3, 6e6))});
  }

  // --- the line ----------------------------------------------------------------------------------

  void bad_line() {
    if (chance(30)) add("noise"_op, {std::floor(spread(1, 3000)), index(1000)});
    add("impair"_op, {1.0 + index(5), index(400), std::floor(spread(100, 2e6))});
    setpoint(host());
    moment();
    if (chance(50)) add("repeat"_op, {host(), index(6)});
    wait();
  }

  void any_request() {
    const double who = host();
    choose([&] { add("stream_rate"_op, {who, one_of({0, 10, 100, 500, 1000, 5000, 65535})}); },
           [&] { add("get"_op, {who, index(kParameterCount + 3)}); },
           [&] { add("list"_op, {who, index(kParameterCount + 3)}); },
           [&] { add("link_counters"_op, {who}); }, [&] { add("control_counters"_op, {who}); },
           [&] { add("group"_op, {who, index(6)}); }, [&] { read_long(who); },
           [&] { add("contradictions"_op, {who}); },
           [&] { add("ping"_op, {who, chance(90) ? 0.0 : 1.0}); },
           [&] { add("hello"_op, {who, side(), one_of({0, 0, 1}), one_of({0, 0, 1})}); },
           [&] { add("restart"_op, {who}); }, [&] { add("repeat"_op, {who, index(8)}); });
  }

  /// What is read from flash, or answered afresh when it is repeated.
  void read_long(double who) {
    choose([&] { add("box_get"_op, {who, index(3)}); },
           [&] { add("box_read"_op, {who, index(3), one_of({0, 56, 32767})}); },
           [&] { add("ledger"_op, {who}); }, [&] { add("unsaved"_op, {who}); },
           [&] { add("configuration_get"_op, {who}); },
           [&] { add("peripheral_get"_op, {who, index(12)}); },
           [&] { add("sensor_stream"_op, {who, one_of({0, 10, 200, 1000})}); },
           [&] { add("hold_get"_op, {who}); }, [&] { add("memory"_op, {who}); });
  }

  void configure_somehow(double who, double board) {
    add("configure"_op, {who, board, index(kLists), one_of({0, 0, 1, 2, 3, 4})});
  }

  /// Messages in any order.
  void anything() {
    for (size_t i = 4 + below(20); i > 0; --i) {
      const auto move = [&] { setpoint(side()); };
      const auto clears = [&](Kind kind) {
        add(kind, {side(), one_of({1, 1, 0, -1}), one_of({0, 0, 0, 1})});
      };
      choose(
          move, move, [&] { interrupt(); }, [&] { parameter(); }, [&] { clears("clear_estop"_op); },
          [&] { clears("clear_fault"_op); },
          [&] { add("trial"_op, {side(), index(6), spread(0.1, 100)}); },
          [&] { add("save"_op, {side(), index(kParameterCount + 2)}); },
          [&] { add("confirm"_op, {side(), side()}); },
          [&] {
            const double who = side();
            configure_somehow(who, index(20));
          },
          [&] {
            if (chance(50)) return add("sensor"_op, {sensed(), side()});
            configure_somehow(side(), -1);
            add("confirm"_op, {side(), side()});
          },
          [&] { any_request(); });
      moment();
    }
  }

  void phase() {
    if (chance(35)) {
      drive(std::floor(spread(50e3, 2e6)));
      interrupt();
      moment();
      if (chance(60)) clear();
      return;
    }
    const size_t kind = below(20);
    if (kind < 1 && is_about(Subject::kParameters)) return contradict();
    if (kind < 2 && is_about(Subject::kParameters)) return parameters();
    if (kind < 3 && is_about(Subject::kParameters)) return tune();
    if (kind < 5 && is_about(Subject::kParameters)) return trial();
    if (kind < 6 && is_about(Subject::kBoards)) return peripherals(below(kLists));
    if (kind < 7 && is_about(Subject::kBoards) && chance(30)) return contact_of_another_board();
    if (kind < 9 && is_about(Subject::kBoards)) return chance(70) ? board() : confirm();
    if (kind < 9 && is_about(Subject::kFlash)) return flash();
    if (kind < 8 && is_about(Subject::kDefects)) return chance(15) ? lose_in_gaps() : wheels();
    if (kind < 13 && is_about(Subject::kDefects)) return floor();
    if (kind < 14 && subject_ != Subject::kSound) return bad_line();
    if (kind < 15 && chance(50)) return bump();
    if (kind < 15) return anything();
    if (kind < 16) return any_request();
    if (kind < 17) return chance(25) ? come_back_late() : reset();
    if (kind < 18) return clear();
    if (kind < 19 && subject_ != Subject::kSound) return add("driver_fails"_op, {side()});
    drive(std::floor(spread(200e3, 5e6)));
  }

  sim::Random random_;
  Scenario scenario_;
  Subject subject_ = Subject::kAnything;
  size_t list_ = 0;    ///< Of peripherals, that was written last.
  double host_ = 0.0;  ///< That opened the last session.
};

}  // namespace wheelwire::explore
