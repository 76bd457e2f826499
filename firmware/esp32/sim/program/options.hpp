// The command line of wheelwire-fwsim.
#pragma once

#include <getopt.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "variables.hpp"

namespace wheelwire::sim {

struct Options {
  std::string link;
  std::string lock;          ///< To lock in place of `link`, if the link is made elsewhere.
  std::string announcement;  ///< Empty: a line of JSON.
  std::string store;
  int socket = -1;  ///< A descriptor in place of the pseudo-terminal.
  int parent = -1;  ///< Id of a process; when it ends, so does this one.
  uint64_t seed = 0;
  double truth_hz = 0.0;
  bool exit_with_stdin = false;
  bool help = false;
  std::vector<std::pair<std::string, double>> settings;  ///< Variables, in the order given.
  std::vector<std::pair<int, double>> presets;           ///< Defaults by a parameter's id.
};

/// A whole string as a number. Throws std::invalid_argument.
inline double parse_number(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0') throw std::invalid_argument("not a number: " + text);
  return value;
}

constexpr double kMaxTruthHz = 1000.0;

inline constexpr const char* kUsage =
    R"(Usage: wheelwire-fwsim [OPTION]...

Runs the firmware's core with a simulated robot, in real time, behind a pseudo-terminal.
The first line on standard output is JSON and names the port.

  --link PATH        make a symbolic link to the port; the same PATH is the same board at every
                     start, and belongs to one simulator at a time
  --lock PATH        lock PATH as if it were the link, without making the link
  --announce TEXT    write TEXT once the port is open, instead of the first line of JSON
  --baud-rate N      of the chip; a host at another rate receives and sends garbage
                     (default: 0, any rate works, as on USB)
  --store FILE       keep saved parameters in FILE; the board, a latched e-stop and what the
                     recorder stores in files beside it (default: in memory)
  --seed N           seed of boot ids and encoder errors (default: random)
  --set NAME=VALUE   set a variable before power-on; may be repeated
  --truth-hz N       write the robot's true state N times a second, as lines of JSON, and
                     at once when the drive is applied or removed
  --exit-with-stdin  end when standard input ends
  --preset ID=VALUE  change the default of the parameter with this id; may be repeated
  --socket FD        use an inherited, connected socket instead of a pseudo-terminal; end when it
                     does
  --parent PID       end when this process ends
  --help             show this

Commands, one per line on standard input, each answered by a line of JSON:
  set NAME VALUE     get NAME       quit
  reset [REASON]     unplug         plug
A number before a command, as in `#7 get x_m`, comes back in its answer, as "number".
REASON is unknown, power_on, external (default), software, panic, task_watchdog,
interrupt_watchdog or brownout.

Variables:
)";

inline std::pair<std::string, double> parse_setting(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos) throw std::invalid_argument("expected NAME=VALUE");
  return {text.substr(0, equals), parse_number(text.substr(equals + 1))};
}

inline int parse_id(const std::string& text) { return static_cast<int>(parse_number(text)); }

inline uint64_t parse_seed(const std::string& text) {
  char* end = nullptr;
  errno = 0;
  const uint64_t seed = std::strtoull(text.c_str(), &end, 0);
  if (text.empty() || *end != '\0' || text[0] == '-' || errno != 0) {
    throw std::invalid_argument("--seed takes a whole number");
  }
  return seed;
}

inline double parse_rate(const std::string& text) {
  const double rate = parse_number(text);
  if (!(rate >= 0.0 && rate <= kMaxTruthHz)) {
    throw std::invalid_argument("--truth-hz takes 0 to 1000");
  }
  return rate;
}

inline uint64_t random_seed() {
  std::random_device device;
  return (static_cast<uint64_t>(device()) << 32) | device();
}

using Text = const std::string&;

struct OptionSpec {
  const char* name;
  int takes;  ///< As getopt_long has it.
  void (*apply)(Options& o, Text value);
};

constexpr OptionSpec kOptions[] = {
    {"link", required_argument, [](Options& o, Text value) { o.link = value; }},
    {"lock", required_argument, [](Options& o, Text value) { o.lock = value; }},
    {"announce", required_argument, [](Options& o, Text value) { o.announcement = value; }},
    {"seed", required_argument, [](Options& o, Text value) { o.seed = parse_seed(value); }},
    {"baud-rate", required_argument,
     [](Options& o, Text value) { o.settings.emplace_back("baud_rate", parse_number(value)); }},
    {"store", required_argument, [](Options& o, Text value) { o.store = value; }},
    {"set", required_argument,
     [](Options& o, Text value) { o.settings.push_back(parse_setting(value)); }},
    {"truth-hz", required_argument, [](Options& o, Text value) { o.truth_hz = parse_rate(value); }},
    {"exit-with-stdin", no_argument, [](Options& o, Text) { o.exit_with_stdin = true; }},
    {"socket", required_argument, [](Options& o, Text value) { o.socket = parse_id(value); }},
    {"parent", required_argument, [](Options& o, Text value) { o.parent = parse_id(value); }},
    {"preset", required_argument,
     [](Options& o, Text value) {
       const auto [id, preset] = parse_setting(value);
       o.presets.emplace_back(parse_id(id), preset);
     }},
    {"help", no_argument, [](Options& o, Text) { o.help = true; }},
};

/// Throws std::invalid_argument with what is wrong.
inline Options parse_options(int argc, char** argv) {
  constexpr int kFirst = 256;  // What getopt_long finds wrong is a character.
  std::vector<option> known;
  for (const OptionSpec& spec : kOptions)
    known.push_back({spec.name, spec.takes, nullptr, kFirst + static_cast<int>(known.size())});
  known.push_back({});
  Options options;
  options.seed = random_seed();
  int found = 0;
  while ((found = ::getopt_long(argc, argv, "", known.data(), nullptr)) != -1) {
    if (found < kFirst) throw std::invalid_argument("see --help");
    kOptions[found - kFirst].apply(options, optarg == nullptr ? "" : optarg);
  }
  if (optind < argc) throw std::invalid_argument(std::string("not an option: ") + argv[optind]);
  return options;
}

inline std::string help_text() {
  std::ostringstream text;
  text << kUsage;
  for (const Variable& variable : variables()) {
    char line[160];
    std::snprintf(line, sizeof line, "  %-26s %-10s %s", variable.name.c_str(), variable.unit,
                  variable.set == nullptr ? "read-only" : "");
    text << line;
    if (variable.set != nullptr) text << variable.minimum << " to " << variable.maximum;
    text << (variable.doc.empty() ? "" : ". ") << variable.doc << '\n';
  }
  return text.str();
}

}  // namespace wheelwire::sim
