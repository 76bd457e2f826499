#include "operation.hpp"

#include <charconv>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "rules.hpp"

namespace wheelwire::explore {

namespace {

constexpr std::array<KindSpec, static_cast<size_t>(Kind::kCount)> kSpecs = {{
    {Kind::kRun, "run", {"us"}},
    {Kind::kService, "service", {}},
    {Kind::kOpen, "open", {"host", "unarmed"}},
    {Kind::kHello, "hello", {"host", "fresh", "version_off", "hash_off"}},
    {Kind::kPing, "ping", {"host", "session"}},
    {Kind::kVelocity, "velocity", {"host", "left", "right", "life_us", "ahead", "session"}},
    {Kind::kDuty, "duty", {"host", "left", "right", "life_us", "ahead", "session"}},
    {Kind::kHold, "hold", {"host", "left", "right", "for_us", "every_us", "duty"}},
    {Kind::kStop, "stop", {"host", "mode", "ahead", "session"}},
    {Kind::kEstop, "estop", {"host"}},
    {Kind::kClearEstop, "clear_estop", {"host", "ahead", "session"}},
    {Kind::kClearFault, "clear_fault", {"host", "ahead", "session"}},
    {Kind::kStreamRate, "stream_rate", {"host", "rate"}},
    {Kind::kGet, "get", {"host", "parameter"}},
    {Kind::kSet, "set", {"host", "parameter", "value", "ahead", "session"}},
    {Kind::kSave, "save", {"host", "parameter"}},
    {Kind::kResetParameters, "reset_parameters", {"host"}},
    {Kind::kList, "list", {"host", "index"}},
    {Kind::kLinkCounters, "link_counters", {"host"}},
    {Kind::kControlCounters, "control_counters", {"host"}},
    {Kind::kTrial, "trial", {"host", "action", "timeout_s"}},
    {Kind::kGroup, "group", {"host", "group"}},
    {Kind::kContradictions, "contradictions", {"host"}},
    {Kind::kHoldGet, "hold_get", {"host"}},
    {Kind::kRestart, "restart", {"host"}},
    {Kind::kConfigurationGet, "configuration_get", {"host"}},
    {Kind::kConfigure, "configure", {"host", "board", "list", "damage"}},
    {Kind::kConfirm, "confirm", {"host", "fingerprint"}},
    {Kind::kBoxGet, "box_get", {"host", "age"}},
    {Kind::kBoxRead, "box_read", {"host", "number", "offset"}},
    {Kind::kLedger, "ledger", {"host"}},
    {Kind::kUnsaved, "unsaved", {"host"}},
    {Kind::kMemory, "memory", {"host"}},
    {Kind::kSensorStream, "sensor_stream", {"host", "rate"}},
    {Kind::kPeripheralGet, "peripheral_get", {"host", "channel"}},
    {Kind::kRepeat, "repeat", {"host", "back"}},
    {Kind::kNoise, "noise", {"bytes", "seed"}},
    {Kind::kImpair, "impair", {"how", "at", "us"}},
    {Kind::kBaud, "baud", {"rate"}},
    {Kind::kContact, "contact", {"open"}},
    {Kind::kSensor, "sensor", {"which", "triggered"}},
    {Kind::kReset, "reset", {"reason"}},
    {Kind::kPowerCut, "power_cut", {"write", "kept"}},
    {Kind::kStoreFails, "store_fails", {"store", "fails"}},
    {Kind::kStoreUnreadable, "store_unreadable", {"faults", "store"}},
    {Kind::kDamage, "damage", {"store", "how"}},
    {Kind::kDriverFails, "driver_fails", {"fails"}},
    {Kind::kBootTime, "boot_time", {"us"}},
    {Kind::kLate, "late", {"us"}},
    {Kind::kClock, "clock", {"ppm"}},
    {Kind::kWire, "wire", {"board", "unwritten", "floating"}},
    {Kind::kSupply, "supply", {"volts", "ohm", "brownout_v"}},
    {Kind::kBattery, "battery", {"volts"}},
    {Kind::kSlope, "slope", {"rad"}},
    {Kind::kFree, "free", {"wheels"}},
    {Kind::kLoad, "load", {"side", "nm"}},
    {Kind::kPush, "push", {"side", "turns"}},
    {Kind::kBlocked, "blocked", {"side", "blocked"}},
    {Kind::kMotor, "motor", {"side", "reversed", "open", "scale"}},
    {Kind::kEncoder, "encoder", {"side", "dead", "reversed", "stuck"}},
    {Kind::kLostEdges, "lost_edges", {"side", "share", "error_ticks"}},
    {Kind::kGaps, "gaps", {"host", "speed", "for_us", "side", "lost_us", "of_us"}},
    {Kind::kSwaps, "swaps", {"motors", "encoders"}},
    {Kind::kCounts, "counts", {"per_revolution"}},
}};

constexpr bool is_in_order() {
  for (size_t i = 0; i < kSpecs.size(); ++i)
    if (kSpecs[i].kind != static_cast<Kind>(i)) return false;
  return true;
}
static_assert(is_in_order());  // Otherwise an operation would be printed as another one.

std::string number(double value) {
  // The shortest text that reads back as the same number.
  char text[40];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  while (true) {
    const size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string_view::npos) return words;
    line.remove_prefix(begin);
    const size_t end = std::min(line.find_first_of(" \t\r"), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

std::string read_operation(const std::vector<std::string_view>& words, Operation& out) {
  for (size_t kind = 0; kind < kSpecs.size(); ++kind) {
    const KindSpec& spec = kSpecs[kind];
    if (words[0] != spec.name) continue;
    out.kind = static_cast<Kind>(kind);
    for (size_t i = 1; i < words.size(); ++i) {
      const size_t equals = words[i].find('=');
      size_t place = 0;
      while (place < kArguments && (spec.arguments[place] == nullptr ||
                                    words[i].substr(0, equals) != spec.arguments[place]))
        ++place;
      if (equals == std::string_view::npos || place == kArguments)
        return std::string(words[0]) + " takes no " + std::string(words[i]);
      out.values[place] = std::strtod(std::string(words[i].substr(equals + 1)).c_str(), nullptr);
    }
    return {};
  }
  return "no operation is called " + std::string(words[0]);
}

}  // namespace

const KindSpec& spec_of(Kind kind) { return kSpecs[static_cast<size_t>(kind)]; }

std::string to_text(const Operation& operation) {
  const KindSpec& spec = spec_of(operation.kind);
  std::string text = spec.name;
  for (size_t i = 0; i < kArguments && spec.arguments[i] != nullptr; ++i)
    text += std::string(" ") + spec.arguments[i] + "=" + number(operation.values[i]);
  return text;
}

std::string to_text(const Scenario& scenario) {
  std::string text = "seed " + std::to_string(scenario.seed) + "\n";
  for (const Operation& operation : scenario.operations) text += to_text(operation) + "\n";
  return text;
}

std::string parse(std::string_view text, Scenario& out) {
  out = {};
  size_t line_number = 0;
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    ++line_number;
    line = line.substr(0, line.find('#'));
    const std::vector<std::string_view> words = words_of(line);
    if (words.empty()) continue;
    std::string wrong;
    if (words[0] == "except" && words.size() == 2) {
      const auto rule = rule_called(words[1]);
      if (!rule) return "line " + std::to_string(line_number) + ": no rule has this code";
      out.excepted |= uint64_t{1} << static_cast<unsigned>(*rule);
    } else if (words[0] == "seed" && words.size() == 2) {
      out.seed = std::strtoull(std::string(words[1]).c_str(), nullptr, 10);
    } else {
      Operation operation;
      wrong = read_operation(words, operation);
      out.operations.push_back(operation);
    }
    if (!wrong.empty()) return "line " + std::to_string(line_number) + ": " + wrong;
  }
  return {};
}

}  // namespace wheelwire::explore
