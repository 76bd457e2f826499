// The host's end of the line: a pseudo-terminal that behaves like a USB serial port.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "descriptor.hpp"
#include "host_port.hpp"
#include "link_file.hpp"

namespace wheelwire::sim {

class PtyPort final : public HostPort {
 public:
  /// Opens a pseudo-terminal in raw mode, and the link to it if `link` is not empty. Throws
  /// std::runtime_error.
  explicit PtyPort(const std::string& link);

  const std::string& name() const override { return name_; }
  int descriptor() const override { return master_.get(); }
  uint32_t host_baud() const override;
  bool ended() const override { return false; }

  Bytes read() override;
  /// What does not fit is lost. Without a reader only the latest write is buffered: a closed serial
  /// port buffers nothing, either.
  void write(const Bytes& data) override;

 private:
  using Clock = std::chrono::steady_clock;

  void check_reader(Clock::time_point now);
  size_t unread() const;

  Descriptor master_;
  std::string name_;
  Descriptor slave_;  ///< Held open: a host that closes the port must not hang it up.
  std::optional<LinkFile> link_;
  size_t unread_ = 0;                               ///< After the last write that was in doubt.
  Clock::time_point last_activity_ = Clock::now();  ///< When the host last read or wrote.
};

}  // namespace wheelwire::sim
