// The host's end of the line: a connected socket that was inherited from the host.
#pragma once

#include "descriptor.hpp"
#include "host_port.hpp"

namespace wheelwire::sim {

class SocketPort final : public HostPort {
 public:
  /// Throws std::runtime_error if `fd` is not a socket.
  explicit SocketPort(int fd);

  const std::string& name() const override { return name_; }
  int descriptor() const override { return socket_.get(); }
  uint32_t host_baud() const override { return 0; }
  bool ended() const override { return ended_; }
  Bytes read() override;
  void write(const Bytes& data) override;

 private:
  Descriptor socket_;
  std::string name_;
  bool ended_ = false;
};

}  // namespace wheelwire::sim
