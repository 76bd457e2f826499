// Explores the whole robot from seeds, or carries out scenarios that are given.
//
//   wheelwire-explore --seed N [--every K] (--seconds S | --count C) [--folder F]
//                     [--except S11] [--shrink SECONDS]      S: of the processor, however busy it
//                     is
//   wheelwire-explore --exhaustive PART/PARTS [--folder F]
//   wheelwire-explore --replay FILE...
//   wheelwire-explore --print N
//   wheelwire-explore --rules
//
// A table of what was reached goes to stdout, by tabs. Exit code 1: a rule is broken; the shortest
// scenario that breaks it is in the folder.
#include <sys/resource.h>

#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
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
  bool print = false;
  bool list_rules = false;
  uint64_t excepted = 0;
  size_t part = 0;
  size_t parts = 0;  ///< 0: no combinations.
};

double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_utime.tv_sec) +
         static_cast<double>(usage.ru_utime.tv_usec) * 1e-6;
}

std::string title(const Finding& finding) {
  return code_of(finding.rule) + " " + std::string(name_of(finding.rule)) + ": " + finding.text;
}

/// Writes the shortest scenario, and says what it breaks.
void report(const Options& options, const Scenario& scenario, const Outcome& outcome) {
  std::printf("broken\t%s\tseed %" PRIu64 ", operation %zu\n", title(outcome.finding).c_str(),
              scenario.seed, outcome.operations);
  std::fflush(stdout);
  const Scenario shortest =
      Shrinker(scenario, outcome.finding.rule, options.shrink_seconds).shortest();
  Coverage unused;
  const Outcome again = carry_out(shortest, unused);
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
    std::optional<Scenario> scenario = next(count);
    if (!scenario) break;
    scenario->excepted = options.excepted;
    const Outcome outcome = carry_out(*scenario, coverage);
    robot_seconds += outcome.seconds;
    ++count;
    found = outcome.found();
    if (found) report(options, *scenario, outcome);
  }
  std::fputs(coverage.text().c_str(), stdout);
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
    Coverage unused;
    const Outcome outcome = carry_out(scenario, unused);
    if (!outcome.found()) continue;
    std::printf("broken\t%s\t%s, operation %zu: %s\n", title(outcome.finding).c_str(), path.c_str(),
                outcome.operations, to_text(scenario.operations[outcome.operations - 1]).c_str());
    result = 1;
  }
  return result;
}

bool read_options(int count, char** words, Options& out) {
  for (int i = 1; i < count; ++i) {
    const std::string word = words[i];
    if (word == "--replay") {
      out.replays.assign(words + i + 1, words + count);
      return !out.replays.empty();
    }
    if (word == "--rules") return out.list_rules = true;
    if (i + 1 == count) return false;
    const char* const value = words[++i];
    if (word == "--seed") {
      out.seed = std::strtoull(value, nullptr, 10);
    } else if (word == "--print") {
      out.seed = std::strtoull(value, nullptr, 10);
      out.print = true;
    } else if (word == "--exhaustive") {
      if (std::sscanf(value, "%zu/%zu", &out.part, &out.parts) != 2 || out.parts == 0) return false;
    } else if (word == "--every") {
      out.every = std::strtoull(value, nullptr, 10);
    } else if (word == "--seconds") {
      out.seconds = std::strtod(value, nullptr);
    } else if (word == "--shrink") {
      out.shrink_seconds = std::strtod(value, nullptr);
    } else if (word == "--count") {
      out.count = std::strtoull(value, nullptr, 10);
    } else if (word == "--except") {
      const auto rule = rule_called(value);
      if (!rule) return false;
      out.excepted |= uint64_t{1} << static_cast<unsigned>(*rule);
    } else if (word == "--folder") {
      out.folder = value;
    } else {
      return false;
    }
  }
  return out.print || out.parts != 0 || out.seconds > 0.0 || out.count != UINT64_MAX;
}

}  // namespace

}  // namespace wheelwire::explore

int main(int count, char** words) {
  using namespace wheelwire::explore;
  Options options;
  if (!read_options(count, words, options)) {
    std::fputs("see the head of explore/main.cpp\n", stderr);
    return 2;
  }
  if (options.list_rules) {
    for (size_t i = 0; i < std::size(kRules); ++i)
      std::printf("%s\t%s\n", code_of(Rule(i)).c_str(), kRules[i].data());
    return 0;
  }
  if (options.print) {
    std::fputs(to_text(Generator(options.seed).scenario()).c_str(), stdout);
    return 0;
  }
  if (options.parts != 0) return visit_all(options);
  return options.replays.empty() ? explore(options) : replay(options.replays);
}
