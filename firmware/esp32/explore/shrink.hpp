// The shortest scenario that still breaks the same rule.
#pragma once

#include <chrono>
#include <cmath>

#include "run.hpp"

namespace wheelwire::explore {

/// What a scenario came to.
struct Outcome {
  Finding finding;        ///< Its text is empty if no rule is broken.
  size_t operations = 0;  ///< How many were carried out.
  double seconds = 0.0;   ///< Of the robot's time.
  Coverage coverage;
  bool found() const { return !finding.text.empty(); }
};

inline Outcome carry_out(const Scenario& scenario) {
  Run run(scenario.seed);
  Outcome outcome;
  for (const Operation& operation : scenario.operations) {
    ++outcome.operations;
    if (!run.apply(operation)) break;
  }
  if (run.finding()) outcome.finding = *run.finding();
  outcome.seconds = run.seconds();
  outcome.coverage = run.coverage();
  return outcome;
}

class Shrinker {
 public:
  /// For at most so many seconds.
  Shrinker(Scenario scenario, Rule rule, double seconds)
      : best_(std::move(scenario)),
        rule_(rule),
        end_(Clock::now() + std::chrono::milliseconds(static_cast<int64_t>(seconds * 1e3))) {}

  /// Leaves out operations, and shortens times and rounds numbers.
  Scenario shortest() {
    for (bool progress = true; progress && !is_over();) {
      progress = leave_out();
      progress = simplify() || progress;
    }
    return best_;
  }

 private:
  using Clock = std::chrono::steady_clock;

  bool is_over() const { return Clock::now() >= end_; }

  /// If it still breaks the rule.
  bool take(Scenario candidate) {
    if (is_over()) return false;
    const Outcome outcome = carry_out(candidate);
    const bool still_breaks = outcome.found() && outcome.finding.rule == rule_;
    if (still_breaks) best_ = std::move(candidate);
    return still_breaks;
  }

  /// Parts of half the scenario, then of a quarter, and so on.
  bool leave_out() {
    bool progress = false;
    for (size_t part = std::max<size_t>(1, best_.operations.size() / 2);; part /= 2) {
      for (size_t at = 0; at < best_.operations.size() && !is_over();) {
        Scenario candidate = best_;
        const auto begin = candidate.operations.begin() + static_cast<std::ptrdiff_t>(at);
        const size_t count = std::min(part, candidate.operations.size() - at);
        candidate.operations.erase(begin, begin + static_cast<std::ptrdiff_t>(count));
        if (take(std::move(candidate))) {
          progress = true;
        } else {
          at += part;
        }
      }
      if (part <= 1) return progress;
    }
  }

  bool simplify() {
    bool progress = false;
    for (size_t at = 0; at < best_.operations.size(); ++at) {
      for (size_t i = 0; i < kMostArguments && !is_over(); ++i) {
        const double value = best_.operations[at].values[i];
        if (value == 0.0 || !std::isfinite(value)) continue;
        const double digits = std::pow(10.0, std::floor(std::log10(std::abs(value))));
        for (const double simpler : {0.0, value / 2.0 > 1e3 ? std::floor(value / 2.0) : value,
                                     std::round(value / digits) * digits}) {
          if (simpler == value) continue;
          Scenario candidate = best_;
          candidate.operations[at].values[i] = simpler;
          if (!take(std::move(candidate))) continue;
          progress = true;
          break;
        }
      }
    }
    return progress;
  }

  Scenario best_;
  Rule rule_;
  Clock::time_point end_;
};

}  // namespace wheelwire::explore
