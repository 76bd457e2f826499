// A scenario as data: what hosts, hands and the power do to the robot, one operation after the
// other. It can be printed, read back as text and shortened.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <initializer_list>
#include <limits>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "names.hpp"

namespace wheelwire::explore {

using enum ParameterId;

constexpr size_t kMostArguments = 6;
using Arguments = std::array<double, kMostArguments>;

/// A kind of operation: its name and what it takes; nullptr ends the arguments.
struct KindSpec {
  std::string_view name;
  std::array<const char*, kMostArguments> arguments;
  /// The request whose fields are the arguments behind the host; 0: it is more than that.
  uint8_t request = 0;
  /// Those of a message that the enumeration of small spaces visits.
  std::initializer_list<Arguments> variants = {};

  constexpr size_t count() const {
    return static_cast<size_t>(std::ranges::find(arguments, nullptr) - arguments.begin());
  }
};

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kLateBoard = 3;  // Any but the image's own.
constexpr double code_of(ParameterId id) { return static_cast<double>(id); }

constexpr KindSpec kKinds[] = {
    // Time.
    {"run", {"us"}},
    {"service", {}},
    // Messages.
    {"open", {"host", "unarmed"}},
    {"hello",
     {"host", "fresh", "version_off", "hash_off"},
     0,
     {{0, 1}, {0, 0}, {1, 1}, {0, 1, 1}, {0, 1, 0, 1}}},
    {"ping", {"host", "session"}, 0, {{0}, {0, 2}}},
    {"velocity",
     {"host", "left", "right", "life_us", "ahead", "session"},
     0,
     {{0, 0.1, 0.1, 1e6, 1, 0},
      {0, 0, 0, 1e6, 1, 0},
      {0, kNan, 0.1, 1e6, 1, 0},
      {0, 0.1, 0.1, -1, 1, 0},
      {0, 0.1, 0.1, 1e6, 0, 0},
      {0, 0.1, 0.1, 1e6, 1, 2}}},
    {"duty",
     {"host", "left", "right", "life_us", "ahead", "session"},
     0,
     {{0, 0.3, 0.3, 1e6, 1, 0}, {0, 0, 0, 1e6, 1, 0}}},
    {"hold", {"host", "left", "right", "for_us", "every_us", "duty"}},
    {"stop",
     {"host", "mode", "ahead", "session"},
     0,
     {{0, 0, 1}, {0, 1, 1}, {0, 3, 1}, {0, 9, 1, 2}}},
    {"estop", {"host"}, 0, {{0}}},
    {"clear_estop", {"host", "ahead", "session"}, 0, {{0, 1}, {0, 1, 2}, {0, 0}}},
    {"clear_fault", {"host", "ahead", "session"}, 0, {{0, 1}}},
    {"stream_rate", {"host", "rate"}, SetStreamRate::kId, {{0, 100}, {0, 60000}}},
    {"get", {"host", "parameter"}, ParameterGet::kId, {{0, 1}, {0, 0}}},
    {"set",
     {"host", "parameter", "value", "ahead", "session"},
     0,
     {{0, code_of(kWheelRadius), 0.04, 1},
      {0, code_of(kWheelRadius), 0.033f, 1},
      {0, code_of(kWheelRadius), 7, 1},
      {0, code_of(kWheelRadius), kNan, 1},
      {0, code_of(kMaxDuty), 0.5, 1},
      {0, code_of(kControlRateHz), 500.5, 1},
      {0, code_of(kEstopInputEnabled), 0, 1},
      {0, code_of(kStreamRateHz), 5000, 1},
      {0, 200, 1, 1}}},
    {"save", {"host", "parameter"}, ParameterSave::kId, {{0, 0}, {0, 8}, {0, 200}}},
    {"reset_parameters", {"host"}, ParameterReset::kId, {{0}}},
    {"list", {"host", "index"}, ParameterList::kId, {{0, 0}, {0, 200}}},
    {"link_counters", {"host"}, LinkCountersGet::kId, {{0}}},
    {"control_counters", {"host"}, ControlCountersGet::kId, {{0}}},
    {"trial",
     {"host", "action", "timeout_s"},
     0,
     {{0, 1, 1}, {0, 1, kNan}, {0, 2, 1}, {0, 2, 99}, {0, 3}, {0, 4}, {0, 0}}},
    {"group", {"host", "group"}, GroupGet::kId, {{0, 1}, {0, 7}}},
    {"contradictions", {"host"}, ContradictionsGet::kId, {{0}}},
    {"hold_get", {"host"}, HoldGet::kId, {{0}}},
    {"restart", {"host"}, Restart::kId, {{0}}},
    {"configuration_get", {"host"}, ConfigurationGet::kId, {{0}}},
    {"configure",
     {"host", "board", "list", "damage"},
     0,
     {{0, kLateBoard, 0}, {0, kLateBoard, 0, 1}, {0, -1, 1}, {0, -1, 1, 4}}},
    {"confirm", {"host", "fingerprint"}, 0, {{0, 0}, {0, 1}}},
    {"box_get", {"host", "age"}, BoxGet::kId, {{0, 0}}},
    {"box_read", {"host", "number", "offset"}, BoxRead::kId, {{0, 1, 0}}},
    {"ledger", {"host"}, LedgerGet::kId, {{0}}},
    {"unsaved", {"host"}, UnsavedGet::kId, {{0}}},
    {"memory", {"host"}, MemoryGet::kId, {{0}}},
    {"sensor_stream", {"host", "rate"}, SensorStream::kId, {{0, 100}}},
    {"peripheral_get", {"host", "channel"}, PeripheralGet::kId, {{0, 0}}},
    {"repeat", {"host", "back"}, 0, {{0, 0}, {0, 1}}},
    // The line.
    {"noise", {"bytes", "seed"}},
    {"impair", {"how", "at", "us"}},
    {"baud", {"rate"}},
    // The robot and what is done to it.
    {"contact", {"open"}},
    {"sensor", {"which", "triggered"}},
    {"reset", {"reason"}},
    {"power_cut", {"write", "kept"}},
    {"store_fails", {"store", "fails"}},
    {"store_unreadable", {"faults", "store"}},
    {"damage", {"store", "how"}},
    {"driver_fails", {"fails"}},
    {"boot_time", {"us"}},
    {"late", {"us"}},
    {"clock", {"ppm"}},
    {"wire", {"board", "unwritten", "floating"}},
    {"supply", {"volts", "ohm", "brownout_v"}},
    {"battery", {"volts"}},
    {"slope", {"rad"}},
    {"free", {"wheels"}},
    {"load", {"side", "nm"}},
    {"push", {"side", "turns"}},
    {"blocked", {"side", "blocked"}},
    {"motor", {"side", "reversed", "open", "scale"}},
    {"encoder", {"side", "dead", "reversed", "stuck"}},
    {"lost_edges", {"side", "share", "error_ticks"}},
    {"gaps", {"host", "speed", "for_us", "side", "lost_us", "of_us"}},
    {"swaps", {"motors", "encoders"}},
    {"counts", {"per_revolution"}},
};

/// An index of kKinds.
using Kind = uint8_t;

/// The kind of this name.
consteval Kind operator""_op(const char* name, size_t size) {
  Kind kind = 0;
  while (kKinds[kind].name != std::string_view(name, size)) ++kind;
  return kind;
}

struct Operation {
  Kind kind = "run"_op;
  Arguments values{};
};

inline Operation make(Kind kind, std::initializer_list<double> values = {}) {
  Operation operation{.kind = kind};
  std::copy(values.begin(), values.end(), operation.values.begin());
  return operation;
}

struct Scenario {
  uint64_t seed = 0;  ///< Of the simulator: boot ids, edges of the encoders.
  std::vector<Operation> operations;
};

/// As `velocity host=0 left=0.2 right=0.2`, without a line's end.
inline std::string to_text(const Operation& operation) {
  const KindSpec& spec = kKinds[operation.kind];
  std::string text(spec.name);
  for (size_t i = 0; i < spec.count(); ++i)
    text += std::string(" ") + spec.arguments[i] + "=" + text_of(operation.values[i]);
  return text;
}

inline std::string to_text(const Scenario& scenario) {
  std::string text = "seed " + std::to_string(scenario.seed) + "\n";
  for (const Operation& operation : scenario.operations) text += to_text(operation) + "\n";
  return text;
}

/// Reads an operation of this name from what is behind it. Returns what is wrong, empty if nothing
/// is.
inline std::string parse(const std::string& name, std::istream& words, Operation& out) {
  const auto spec = std::ranges::find(kKinds, name, &KindSpec::name);
  if (spec == std::end(kKinds)) return "no operation is called " + name;
  out.kind = static_cast<Kind>(spec - kKinds);
  for (std::string word; words >> word;) {
    const size_t equals = word.find('=');
    size_t place = 0;
    while (place < spec->count() && word.substr(0, equals) != spec->arguments[place]) ++place;
    if (equals == std::string::npos || place == spec->count()) return name + " takes no " + word;
    out.values[place] = std::strtod(word.c_str() + equals + 1, nullptr);
  }
  return {};
}

/// Reads what to_text() wrote; `#` begins a comment. Returns what is wrong, empty if nothing is.
inline std::string parse(const std::string& text, Scenario& out) {
  out = {};
  std::istringstream lines(text);
  std::string line;
  for (size_t number = 1; std::getline(lines, line); ++number) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string name;
    if (!(words >> name)) continue;
    std::string wrong;
    std::string value;
    if (name == "seed" && words >> value) {
      out.seed = std::strtoull(value.c_str(), nullptr, 10);
    } else {
      wrong = parse(name, words, out.operations.emplace_back());
    }
    if (!wrong.empty()) return "line " + std::to_string(number) + ": " + wrong;
  }
  return {};
}

}  // namespace wheelwire::explore
