// The commands on standard input.
#pragma once

#include <string>
#include <vector>

#include "json.hpp"
#include "simulated_device.hpp"

namespace wheelwire::sim {

class Commands {
 public:
  explicit Commands(SimulatedDevice& device) : device_(device) {}

  /// Carries out one line, or changes nothing if it cannot. Returns the answer, which says why, and
  /// which has the number that the line began with.
  std::string run(const std::string& line);
  bool quit() const { return quit_; }

 private:
  JsonLine obey(const std::vector<std::string>& words);
  JsonLine set(const std::string& name, const std::string& value);
  JsonLine value_of(const char* command, const std::string& name) const;
  JsonLine reset(const std::string& reason);
  JsonLine plug();
  JsonLine unplug();

  SimulatedDevice& device_;
  bool quit_ = false;
};

}  // namespace wheelwire::sim
