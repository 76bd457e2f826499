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
    {"run", {"us"}},
    {"service", {}},
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
    {"sensor_stream", {"host", "rate"}},
    {"peripheral_get", {"host", "channel"}},
    {"repeat", {"host", "back"}},
    {"noise", {"bytes", "seed"}},
    {"impair", {"how", "at", "us"}},
    {"baud", {"rate"}},
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
}};

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
