// The commands on standard input.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "json.hpp"
#include "reset_reason.hpp"
#include "simulated_device.hpp"
#include "variables.hpp"

namespace wheelwire::sim {

class Commands {
 public:
  explicit Commands(SimulatedDevice& device) : device_(device) {}

  /// Carries out one line, or changes nothing if it cannot. Returns the answer, which says why, and
  /// which has the number that the line began with.
  std::string run(const std::string& line) {
    std::vector<std::string> words = split(line);
    const std::optional<uint64_t> number = take_number(words);
    JsonLine answer = obey(words);
    if (number) answer.add("number", *number);
    return answer.str();
  }

  bool quit() const { return quit_; }

 private:
  static std::vector<std::string> split(const std::string& line) {
    std::istringstream stream(line);
    std::vector<std::string> words;
    for (std::string word; stream >> word;) words.push_back(word);
    return words;
  }

  /// Removes a leading `#NUMBER` from the words. If it is not a number it stays, and the line is
  /// not a command.
  static std::optional<uint64_t> take_number(std::vector<std::string>& words) {
    constexpr size_t kDigits = 18;  // any number of them fits into 64 bits
    if (words.empty() || words[0][0] != '#') return std::nullopt;
    const std::string digits = words[0].substr(1);
    if (digits.empty() || digits.size() > kDigits) return std::nullopt;
    if (digits.find_first_not_of("0123456789") != std::string::npos) return std::nullopt;
    words.erase(words.begin());
    return std::stoull(digits);
  }

  static JsonLine done(std::string_view command) {
    JsonLine answer("answer");
    answer.add("ok", true).add("command", command);
    return answer;
  }

  static void require(VariableStatus status, const std::string& name) {
    switch (status) {
      case VariableStatus::kOk:
        return;
      case VariableStatus::kUnknownName:
        throw std::invalid_argument("no variable " + name + "; see --help");
      case VariableStatus::kReadOnly:
        throw std::invalid_argument(name + " is read-only");
      case VariableStatus::kOutOfRange:
        throw std::invalid_argument("out of range; see --help for the bounds of " + name);
    }
  }

  JsonLine obey(const std::vector<std::string>& words) {
    try {
      if (words.size() == 3 && words[0] == "set") return set(words[1], words[2]);
      if (words.size() == 2 && words[0] == "get") return value_of("get", words[1]);
      if (words.size() == 2 && words[0] == "reset") return reset(words[1]);
      if (words.size() == 1 && words[0] == "reset") return reset("external");
      if (words.size() == 1 && words[0] == "plug") return plug();
      if (words.size() == 1 && words[0] == "unplug") return unplug();
      if (words.size() == 1 && words[0] == "quit") {
        quit_ = true;
        return done("quit");
      }
      throw std::invalid_argument("not a command; see --help");
    } catch (const std::exception& error) {
      JsonLine refusal("answer");
      refusal.add("ok", false).add("error", error.what());
      return refusal;
    }
  }

  JsonLine set(const std::string& name, const std::string& value) {
    require(set_variable(device_.simulator(), name, parse_number(value)), name);
    return value_of("set", name);
  }

  JsonLine value_of(const char* command, const std::string& name) const {
    double value = 0.0;
    require(get_variable(device_.simulator(), name, value), name);
    return done(command).add("name", name).add("value", value);
  }

  JsonLine reset(const std::string& reason) {
    const auto* found = std::find(kResetReasonNames.begin(), kResetReasonNames.end(), reason);
    if (found == kResetReasonNames.end()) {
      throw std::invalid_argument("no reset reason " + reason + "; see --help");
    }
    device_.simulator().reset(static_cast<ResetReason>(found - kResetReasonNames.begin()));
    return done("reset").add("boot_id", uint64_t{device_.simulator().boot_id()});
  }

  JsonLine plug() {
    if (device_.is_plugged()) throw std::invalid_argument("plugged in already");
    device_.plug();
    return done("plug").add("port", device_.port_name());
  }

  JsonLine unplug() {
    if (!device_.is_plugged()) throw std::invalid_argument("unplugged already");
    device_.unplug();
    return done("unplug");
  }

  SimulatedDevice& device_;
  bool quit_ = false;
};

}  // namespace wheelwire::sim
