// Explores the whole robot from seeds, or carries out scenarios that are given.
//
//   wheelwire-explore --seed N [--every K] (--seconds S | --count C) [--folder F]
//                     [--shrink SECONDS]     S: of the processor, however busy it is
//   wheelwire-explore --exhaustive PART/PARTS [--folder F]
//   wheelwire-explore --replay FILE...
//   wheelwire-explore --print N
//   wheelwire-explore --rules
//
// The transitions and refusals that were seen go to stdout, by tabs. Exit code 1: a rule is broken;
// the shortest scenario that breaks it is in the folder.
#include <cinttypes>
#include <cstdio>
#include <ctime>
#include <exception>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "exhaustive.hpp"
#include "generator.hpp"
#include "shrink.hpp"

namespace wheelwire::explore {

namespace {

struct Options {
  uint64_t seed = 1;
  uint64_t every = 1;
  double seconds = 0.0;
  double shrink_seconds = 60.0;  ///< At most.
  uint64_t count = UINT64_MAX;
  std::string folder = ".";
  std::vector<std::string> replays;
  std::optional<uint64_t> print;  ///< A seed.
  bool list_rules = false;
  size_t part = 0;
  size_t parts = 0;  ///< 0: no combinations.
};

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::string title(const Finding& finding) {
  return code_of(finding.rule) + " " + std::string(name_of(finding.rule)) + ": " + finding.text;
}

/// Writes the shortest scenario, and says what it breaks.
void report(const Options& options, Scenario scenario, const Outcome& outcome) {
  std::printf("broken\t%s\tseed %" PRIu64 ", operation %zu\n", title(outcome.finding).c_str(),
              scenario.seed, outcome.operations);
  std::fflush(stdout);
  scenario.operations.resize(outcome.operations);
  const Scenario shortest =
      Shrinker(scenario, outcome.finding.rule, options.shrink_seconds).shortest();
  const Outcome again = carry_out(shortest);
  const std::string path = options.folder + "/" + code_of(outcome.finding.rule) + "-" +
                           std::to_string(scenario.seed) + ".txt";
  std::ofstream(path) << "# " << title(again.finding) << "\n" << to_text(shortest);
  std::printf("file\t%s\t%s\n", path.c_str(), title(again.finding).c_str());
}

/// Carries out what `next(index)` gives until it gives nothing, or a rule is broken.
template <typename Next>
int carry_out_each(const Options& options, Next next) {
  const double cpu_begin = cpu_seconds();
  Coverage coverage;
  double robot_seconds = 0.0;
  uint64_t count = 0;
  bool found = false;
  while (!found && (options.seconds == 0.0 || cpu_seconds() - cpu_begin < options.seconds)) {
    const std::optional<Scenario> scenario = next(count);
    if (!scenario) break;
    const Outcome outcome = carry_out(*scenario);
    for (const auto& [cell, seen] : outcome.coverage) coverage[cell] += seen;
    robot_seconds += outcome.seconds;
    ++count;
    found = outcome.found();
    if (found) report(options, *scenario, outcome);
  }
  for (const auto& [cell, seen] : coverage) std::printf("%s\t%" PRIu64 "\n", cell.c_str(), seen);
  std::printf("ran\tscenarios\t%" PRIu64 "\nran\trobot seconds\t%.0f\nran\tcpu seconds\t%.2f\n",
              count, robot_seconds, cpu_seconds() - cpu_begin);
  return found ? 1 : 0;
}

int explore(const Options& options) {
  return carry_out_each(options, [&](uint64_t index) -> std::optional<Scenario> {
    if (index >= options.count) return std::nullopt;
    return Generator(options.seed + index * options.every).scenario();
  });
}

/// Every so many of the combinations.
int visit_all(const Options& options) {
  const std::vector<Operations> all = all_combinations();
  return carry_out_each(options, [&](uint64_t index) -> std::optional<Scenario> {
    const size_t at = options.part + index * options.parts;
    if (at >= all.size()) return std::nullopt;
    return Scenario{.seed = 1, .operations = all[at]};
  });
}

int replay(const std::vector<std::string>& paths) {
  int result = 0;
  for (const std::string& path : paths) {
    std::ifstream file(path);
    const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    Scenario scenario;
    const std::string wrong = file ? parse(text, scenario) : "cannot be read";
    if (!wrong.empty()) {
      std::fprintf(stderr, "%s: %s\n", path.c_str(), wrong.c_str());
      return 2;
    }
    const Outcome outcome = carry_out(scenario);
    if (!outcome.found()) continue;
    std::printf("broken\t%s\t%s, operation %zu: %s\n", title(outcome.finding).c_str(), path.c_str(),
                outcome.operations, to_text(scenario.operations[outcome.operations - 1]).c_str());
    result = 1;
  }
  return result;
}

using Text = const std::string&;

constexpr struct {
  std::string_view name;
  void (*take)(Options& o, Text value);  ///< Throws if that is not a value.
} kOptions[] = {
    {"--seed", [](Options& o, Text value) { o.seed = std::stoull(value); }},
    {"--every", [](Options& o, Text value) { o.every = std::stoull(value); }},
    {"--count", [](Options& o, Text value) { o.count = std::stoull(value); }},
    {"--seconds", [](Options& o, Text value) { o.seconds = std::stod(value); }},
    {"--shrink", [](Options& o, Text value) { o.shrink_seconds = std::stod(value); }},
    {"--folder", [](Options& o, Text value) { o.folder = value; }},
    {"--print", [](Options& o, Text value) { o.print = std::stoull(value); }},
    {"--exhaustive",
     [](Options& o, Text value) {
       size_t slash = 0;
       o.part = std::stoull(value, &slash);
       o.parts = std::stoull(value.substr(slash + 1));
     }},
};

/// False if they cannot be understood, or say nothing to do.
bool read_options(const std::vector<std::string>& words, Options& out) try {
  for (size_t i = 0; i < words.size(); i += 2) {
    if (words[i] == "--rules") return out.list_rules = true;
    if (words[i] == "--replay") {
      out.replays = {words.begin() + static_cast<std::ptrdiff_t>(i) + 1, words.end()};
      return !out.replays.empty();
    }
    const auto* option = std::begin(kOptions);
    while (option != std::end(kOptions) && option->name != words[i]) ++option;
    if (option == std::end(kOptions) || i + 1 == words.size()) return false;
    option->take(out, words[i + 1]);
  }
  return out.print || out.parts != 0 || out.seconds > 0.0 || out.count != UINT64_MAX;
} catch (const std::exception&) {
  return false;
}

}  // namespace

}  // namespace wheelwire::explore

int main(int count, char** words) {
  using namespace wheelwire::explore;
  Options options;
  if (!read_options({words + 1, words + count}, options)) {
    std::fputs("see the head of explore/main.cpp\n", stderr);
    return 2;
  }
  if (options.list_rules) {
    for (size_t i = 0; i < std::size(kRules); ++i)
      std::printf("%s\t%s\n", code_of(Rule(i)).c_str(), kRules[i].data());
    return 0;
  }
  if (options.print) {
    std::fputs(to_text(Generator(*options.print).scenario()).c_str(), stdout);
    return 0;
  }
  if (options.parts != 0) return visit_all(options);
  return options.replays.empty() ? explore(options) : replay(options.replays);
}
