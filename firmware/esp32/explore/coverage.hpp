// What the scenarios reached, as tables.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>

#include "names.hpp"

namespace wheelwire::explore {

class Coverage {
 public:
  void transition(SupervisorState before, SupervisorEvent event) {
    ++counts_["transition"][name_of(before) + " " + name_of(event)];
  }
  void refusal(uint8_t message, RefusalCode code) {
    ++counts_["refusal"][name_of_message(message) + " " + name_of(code)];
  }
  void accepted(uint8_t message, SupervisorState state) {
    ++counts_["carried out"][name_of_message(message) + " " + name_of(state)];
  }
  void reset(ResetReason reason, SupervisorState state) {
    ++counts_["reset"][name_of(reason) + " " + name_of(state)];
  }
  void board(uint32_t believed, uint32_t wired, ConfigurationState state) {
    ++counts_["board"]
             [name_of_board(believed) + ", " + name_of_board(wired) + ", " + name_of(state)];
  }

  /// nullptr: nothing happened to it.
  void battery(const char* what) {
    if (what != nullptr) ++counts_["battery"][what];
  }

  void add(const Coverage& other) {
    for (const auto& [table, cells] : other.counts_)
      for (const auto& [cell, count] : cells) counts_[table][cell] += count;
  }
  /// A line for each cell: table, its keys, and how often it was seen, by tabs.
  std::string text() const {
    std::string text;
    for (const auto& [table, cells] : counts_)
      for (const auto& [cell, count] : cells)
        text += table + "\t" + cell + "\t" + std::to_string(count) + "\n";
    return text;
  }

 private:
  std::map<std::string, std::map<std::string, uint64_t>> counts_;
};

}  // namespace wheelwire::explore
