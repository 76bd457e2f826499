// The commands on standard input.
#pragma once

#include <string>

#include "simulated_device.hpp"

namespace wheelwire::sim {

class Commands {
 public:
  explicit Commands(SimulatedDevice& device) : device_(device) {}

  /// Carries out one line, or changes nothing if it cannot. Returns the answer, which says why.
  std::string run(const std::string& line);
  bool quit() const { return quit_; }

 private:
  std::string set(const std::string& name, const std::string& value);
  std::string value_of(const char* command, const std::string& name) const;
  std::string reset(const std::string& reason);
  std::string plug();
  std::string unplug();

  SimulatedDevice& device_;
  bool quit_ = false;
};

}  // namespace wheelwire::sim
