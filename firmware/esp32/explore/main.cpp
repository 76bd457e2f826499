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

#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "coverage.hpp"
#include "exhaustive.hpp"
#include "generator.hpp"
#include "rules.hpp"
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
  const RuleSpec& spec = spec_of(finding.rule);
  return std::string(spec.code) + " " + spec.name + ": " + finding.text;
}

/// Writes the shortest scenario, and says what it breaks.
void report(const Options& options, const Scenario& scenario, const Outcome& outcome) {
  std::printf("broken\t%s\tseed %llu, operation %zu\n", title(outcome.finding).c_str(),
              static_cast<unsigned long long>(scenario.seed), outcome.operations);
  std::fflush(stdout);
  const Scenario shortest = shrink(scenario, outcome.finding.rule, options.shrink_seconds);
  Coverage unused;
  const Outcome again = carry_out(shortest, unused);
  const RuleSpec& spec = spec_of(outcome.finding.rule);
  const std::string name = std::string(spec.code) + "-" + std::to_string(scenario.seed) + ".txt";
  const std::string path = options.folder + "/" + name;
  std::ofstream(path) << "# " << title(again.finding) << "\n" << to_text(shortest);
  std::printf("file\t%s\t%s\n", path.c_str(), title(again.finding).c_str());
}

int explore(const Options& options) {
  const double cpu_begin = cpu_seconds();
  Coverage coverage;
  double robot_seconds = 0.0;
  uint64_t scenarios = 0;
  int result = 0;
  for (uint64_t seed = options.seed; scenarios < options.count; seed += options.every) {
    if (options.seconds > 0.0 && cpu_seconds() - cpu_begin >= options.seconds) break;
    Scenario scenario = generate(seed);
    scenario.excepted = options.excepted;
    const Outcome outcome = carry_out(scenario, coverage);
    robot_seconds += outcome.seconds;
    ++scenarios;
    if (!outcome.found()) continue;
    report(options, scenario, outcome);
    result = 1;
    break;
  }
  std::fputs(coverage.text().c_str(), stdout);
  std::printf("ran\tscenarios\t%llu\nran\trobot seconds\t%.0f\nran\tcpu seconds\t%.2f\n",
              static_cast<unsigned long long>(scenarios), robot_seconds, cpu_seconds() - cpu_begin);
  return result;
}

/// Every so many of the combinations.
int visit_all(const Options& options) {
  const double cpu_begin = cpu_seconds();
  Coverage coverage;
  const std::vector<Scenario> scenarios = all_combinations();
  uint64_t visited = 0;
  int result = 0;
  for (size_t i = options.part; i < scenarios.size(); i += options.parts) {
    Scenario scenario = scenarios[i];
    scenario.excepted = options.excepted;
    const Outcome outcome = carry_out(scenario, coverage);
    ++visited;
    if (!outcome.found()) continue;
    report(options, scenario, outcome);
    result = 1;
    break;
  }
  std::fputs(coverage.text().c_str(), stdout);
  std::printf("ran\tscenarios\t%llu\nran\tcpu seconds\t%.2f\n",
              static_cast<unsigned long long>(visited), cpu_seconds() - cpu_begin);
  return result;
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
    for (const RuleSpec& rule : all_rules()) std::printf("%s\t%s\n", rule.code, rule.name);
    return 0;
  }
  if (options.print) {
    std::fputs(to_text(generate(options.seed)).c_str(), stdout);
    return 0;
  }
  if (options.parts != 0) return visit_all(options);
  return options.replays.empty() ? explore(options) : replay(options.replays);
}
