#include "operation.hpp"

#include <cstdlib>

#include "names.hpp"
#include "rule_ids.hpp"

namespace wheelwire::explore {

namespace {

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
  for (Kind kind = 0; kind < std::size(kKinds); ++kind) {
    const KindSpec& spec = kKinds[kind];
    if (words[0] != spec.name) continue;
    out.kind = kind;
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

std::string to_text(const Operation& operation) {
  const KindSpec& spec = kKinds[operation.kind];
  std::string text(spec.name);
  for (size_t i = 0; i < kArguments && spec.arguments[i] != nullptr; ++i)
    text += std::string(" ") + spec.arguments[i] + "=" + text_of(operation.values[i]);
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
