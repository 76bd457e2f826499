// What the scenarios reached, as tables.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace wheelwire::explore {

class Coverage {
 public:
  /// Once more: a table, and its cell's keys in words.
  void count(const std::string& table, const std::string& cell) { ++counts_[table][cell]; }

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
