// The simulated device and the port that it is plugged into, or not.
#pragma once

#include <optional>
#include <string>

#include "options.hpp"
#include "pty_port.hpp"
#include "simulator.hpp"

namespace wheelwire::sim {

class Device {
 public:
  /// Throws std::invalid_argument for a setting that cannot be, std::runtime_error for a port that
  /// cannot be opened.
  explicit Device(const Options& options);

  Simulator& simulator() { return simulator_; }
  const Simulator& simulator() const { return simulator_; }

  bool is_plugged() const { return port_.has_value(); }
  const std::string& port_name() const { return port_->name(); }
  /// -1 when unplugged.
  int descriptor() const { return port_ ? port_->descriptor() : -1; }
  void plug();
  void unplug() { port_.reset(); }

  /// Takes what the host has sent onto the line.
  void receive();
  /// Hands what is on the line to the host; unplugged, it is lost.
  void send();

 private:
  std::string link_;
  Simulator simulator_;
  std::optional<PtyPort> port_;
};

}  // namespace wheelwire::sim
