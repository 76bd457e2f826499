// The simulated device and the port that it is plugged into, or not.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "file.hpp"
#include "host_port.hpp"
#include "link_lock.hpp"
#include "options.hpp"
#include "pty_port.hpp"
#include "random.hpp"
#include "simulator.hpp"
#include "socket_port.hpp"
#include "variables.hpp"

namespace wheelwire::sim {

class SimulatedDevice {
 public:
  /// Throws std::invalid_argument for a bad setting, std::runtime_error if the port cannot be
  /// opened.
  explicit SimulatedDevice(const Options& options)
      : link_(options.link), socket_(options.socket), simulator_(options.seed) {
    const std::string& owned = options.lock.empty() ? link_ : options.lock;
    if (!owned.empty()) lock_.emplace(owned);
    if (!link_.empty()) simulator_.set_board_id(board_of(link_));
    // All simulators that a host process starts are the same board to it.
    if (socket_ >= 0) simulator_.set_board_id(mix(static_cast<uint64_t>(options.parent)) >> 16);
    if (!options.store.empty()) use_files(simulator_.board, options.store);
    for (const auto& [name, value] : options.settings) {
      if (set_variable(simulator_, name, value) != VariableStatus::kOk) {
        throw std::invalid_argument("cannot set " + name + "; see --help for names and bounds");
      }
    }
    for (const auto& [parameter, value] : options.presets) {
      if (!simulator_.preset(parameter, static_cast<float>(value))) {
        throw std::invalid_argument("cannot preset parameter " + std::to_string(parameter));
      }
    }
    // The constructor has already powered the device on; the settings must hold from power-on.
    simulator_.reset(ResetReason::kPowerOn);
    plug();
  }

  Simulator& simulator() { return simulator_; }
  const Simulator& simulator() const { return simulator_; }
  bool is_plugged() const { return port_ != nullptr; }
  const std::string& port_name() const { return port_->name(); }
  /// -1 when unplugged.
  int descriptor() const { return port_ ? port_->descriptor() : -1; }

  /// Throws std::runtime_error. A socket cannot be plugged in again.
  void plug() {
    port_.reset();
    if (socket_ == kSocketGone) throw std::runtime_error("the socket is gone");
    if (socket_ >= 0)
      port_ = std::make_unique<SocketPort>(std::exchange(socket_, kSocketGone));
    else
      port_ = std::make_unique<PtyPort>(link_);
  }

  void unplug() { port_.reset(); }
  /// The host that this process was started for is gone.
  bool host_ended() const { return port_ && port_->ended(); }

  /// Puts what the host has sent onto the line.
  void receive() {
    if (!port_) return;
    Bytes data = port_->read();
    Line& line = simulator_.board.line;
    if (line.baud() != 0) data = resample(data, port_->host_baud(), line.baud());
    line.host_write(data.data(), data.size());
  }

  /// Hands what is on the line to the host; if unplugged, it is lost.
  void send() {
    Line& line = simulator_.board.line;
    if (line.host_waiting() == 0) return;
    Bytes data(line.host_waiting());
    line.host_read(data.data(), data.size());
    if (!port_) return;
    if (line.baud() != 0) data = resample(data, line.baud(), port_->host_baud());
    port_->write(data);
  }

 private:
  static constexpr int kSocketGone = -2;

  /// The same link is the same board at every start, so a host that knows the board resumes.
  static uint64_t board_of(const std::string& link) {
    uint64_t hash = 0;
    for (const char c : std::filesystem::absolute(link).lexically_normal().string()) {
      hash = mix(hash ^ static_cast<unsigned char>(c));
    }
    return hash >> 16;
  }

  std::optional<LinkLock> lock_;
  std::string link_;
  int socket_;
  Simulator simulator_;
  std::unique_ptr<HostPort> port_;
};

}  // namespace wheelwire::sim
