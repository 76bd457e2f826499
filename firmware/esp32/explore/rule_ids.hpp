// The rules of docs/safety.md.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace wheelwire::explore {

/// Their names, in the order of their codes: the first one is S01.
constexpr std::string_view kRules[] = {
    "drive-only-in-driving",
    "contact-stops",
    "deadline-stops",
    "confirmed-board-only",
    "session-and-clock-first",
    "wheel-fault-in-time",
    "sound-robot-drives-on",
    "latch-ends-by-clear",
    "estop-survives-power-loss",
    "clear-does-not-restart",
    "slew-within-limit",
    "request-once",
    "ticks-conserved",
    "flash-old-or-new",
    "trial-ends-with-its-session",
    "contradictions-never-drive",
    "answers-as-specified",
    "no-hard-switch",
    "within-limits",
    "stop-at-once",
    "state-by-its-table",
    "rolling-is-reported",
    "stops-as-asked",
    "contact-input-of-its-board",
    "late-step-is-a-fault",
    "board-stays-while-estopped",
    "flash-only-at-rest",
    "not-against-a-bumper",
    "external-stops",
    "lost-is-not-empty",
    "start-does-not-drive",
    "release-does-not-restart",
    "stop-holds",
    "not-too-fast",
    "values-change-at-rest",
    "hold-is-named",
};

/// An index of kRules.
enum class Rule : uint8_t {};

/// The rule of this name.
consteval Rule operator""_rule(const char* name, size_t size) {
  uint8_t index = 0;
  while (kRules[index] != std::string_view(name, size)) ++index;
  return Rule{index};
}

inline std::string_view name_of(Rule rule) { return kRules[static_cast<size_t>(rule)]; }

inline std::string code_of(Rule rule) {
  const size_t number = static_cast<size_t>(rule) + 1;
  return (number < 10 ? "S0" : "S") + std::to_string(number);
}

/// Something is wrong; `text` says what. Empty: nothing is.
struct Finding {
  Rule rule = "answers-as-specified"_rule;
  std::string text;
};

}  // namespace wheelwire::explore
