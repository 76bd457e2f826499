// The simulated device and the port that it is plugged into, or not.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "host_port.hpp"
#include "link_lock.hpp"
#include "options.hpp"
#include "simulator.hpp"

namespace wheelwire::sim {

class SimulatedDevice {
 public:
  /// Throws std::invalid_argument for a bad setting, std::runtime_error if the port cannot be
  /// opened.
  explicit SimulatedDevice(const Options& options);

  Simulator& simulator() { return simulator_; }
  const Simulator& simulator() const { return simulator_; }

  bool is_plugged() const { return port_ != nullptr; }
  const std::string& port_name() const { return port_->name(); }
  /// -1 when unplugged.
  int descriptor() const { return port_ ? port_->descriptor() : -1; }
  /// Throws std::runtime_error. A socket cannot be plugged in again.
  void plug();
  void unplug() { port_.reset(); }
  /// The host that this process was started for is gone.
  bool host_ended() const { return port_ && port_->ended(); }

  /// Puts what the host has sent onto the line.
  void receive();
  /// Hands what is on the line to the host; if unplugged, it is lost.
  void send();

 private:
  std::optional<LinkLock> lock_;
  std::string link_;
  int socket_;
  Simulator simulator_;
  std::unique_ptr<HostPort> port_;
};

}  // namespace wheelwire::sim
