// The host's end of the line: a pseudo-terminal that behaves like a USB serial port.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "descriptor.hpp"
#include "link_file.hpp"
#include "uart.hpp"

namespace wheelwire::sim {

class PtyPort {
 public:
  /// Opens a pseudo-terminal in raw mode, and the link to it if `link` is not empty. Throws
  /// std::runtime_error.
  explicit PtyPort(const std::string& link);

  const std::string& name() const { return name_; }
  int descriptor() const { return master_.get(); }
  /// What the host has set the port to; 0 when it hung up.
  uint32_t host_baud() const;

  /// What the host has sent.
  Bytes read();
  /// What does not fit is lost, and so is all but the latest while nobody reads: the kernel keeps
  /// nothing for a closed serial port either.
  void write(const Bytes& data);

 private:
  using Clock = std::chrono::steady_clock;

  void look_for_reader(Clock::time_point now);
  size_t unread() const;

  Descriptor master_;
  std::string name_;
  Descriptor slave_;  ///< Held open: a host that closes the port must not hang it up.
  std::optional<LinkFile> link_;
  size_t unread_ = 0;                              ///< After the last write that was in doubt.
  Clock::time_point sign_of_life_ = Clock::now();  ///< When the host last read or wrote.
};

}  // namespace wheelwire::sim
