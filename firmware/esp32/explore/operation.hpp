// A scenario as data: what hosts, hands and the power do to the robot, one operation after the
// other. It can be printed, read back as text and shortened.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

namespace wheelwire::explore {

constexpr size_t kArguments = 6;

/// The name of a kind of operation and of what it takes; nullptr ends the arguments.
struct KindSpec {
  std::string_view name;
  std::array<const char*, kArguments> arguments;
};

constexpr KindSpec kKinds[] = {
    // Time.
    {"run", {"us"}},
    {"service", {}},
    // Messages.
    {"open", {"host", "unarmed"}},
    {"hello", {"host", "fresh", "version_off", "hash_off"}},
    {"ping", {"host", "session"}},
    {"velocity", {"host", "left", "right", "life_us", "ahead", "session"}},
    {"duty", {"host", "left", "right", "life_us", "ahead", "session"}},
    {"hold", {"host", "left", "right", "for_us", "every_us", "duty"}},
    {"stop", {"host", "mode", "ahead", "session"}},
    {"estop", {"host"}},
    {"clear_estop", {"host", "ahead", "session"}},
    {"clear_fault", {"host", "ahead", "session"}},
    {"stream_rate", {"host", "rate"}},
    {"get", {"host", "parameter"}},
    {"set", {"host", "parameter", "value", "ahead", "session"}},
    {"save", {"host", "parameter"}},
    {"reset_parameters", {"host"}},
    {"list", {"host", "index"}},
    {"link_counters", {"host"}},
    {"control_counters", {"host"}},
    {"trial", {"host", "action", "timeout_s"}},
    {"group", {"host", "group"}},
    {"contradictions", {"host"}},
    {"hold_get", {"host"}},
    {"restart", {"host"}},
    {"configuration_get", {"host"}},
    {"configure", {"host", "board", "list", "damage"}},
    {"confirm", {"host", "fingerprint"}},
    {"box_get", {"host", "age"}},
    {"box_read", {"host", "number", "offset"}},
    {"ledger", {"host"}},
    {"unsaved", {"host"}},
    {"memory", {"host"}},
    {"sensor_stream", {"host", "rate"}},
    {"peripheral_get", {"host", "channel"}},
    {"repeat", {"host", "back"}},
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
  std::array<double, kArguments> values{};
};

inline Operation make(Kind kind, std::initializer_list<double> values = {}) {
  Operation operation{.kind = kind};
  std::copy(values.begin(), values.end(), operation.values.begin());
  return operation;
}

/// As `velocity host=0 left=0.2 right=0.2`, without a line's end.
std::string to_text(const Operation& operation);

struct Scenario {
  uint64_t seed = 0;      ///< Of the simulator: boot ids, edges of the encoders.
  uint64_t excepted = 0;  ///< Rules that are not looked at, as bits.
  std::vector<Operation> operations;
};

std::string to_text(const Scenario& scenario);

/// Reads what to_text() wrote; `#` begins a comment. Returns what is wrong, empty if nothing is.
std::string parse(std::string_view text, Scenario& out);

}  // namespace wheelwire::explore
