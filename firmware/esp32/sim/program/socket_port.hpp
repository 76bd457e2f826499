// The host's end of the line: a connected socket that was inherited from the host.
#pragma once

#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "host_port.hpp"

namespace wheelwire::sim {

class SocketPort final : public HostPort {
 public:
  /// Throws std::runtime_error if `fd` is not a socket.
  explicit SocketPort(int fd) : HostPort(Descriptor(fd), "socket " + std::to_string(fd)) {
    if (::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof kSendBuffer) != 0) {
      throw std::runtime_error("cannot use " + name() + ": " + std::strerror(errno));
    }
  }

  bool ended() const override { return ended_; }

  Bytes read() override {
    Bytes data(4096);
    const ssize_t count = ::recv(descriptor(), data.data(), data.size(), MSG_DONTWAIT);
    ended_ = count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR);
    data.resize(count > 0 ? static_cast<size_t>(count) : 0);
    return data;
  }

  void write(const Bytes& data) override {
    [[maybe_unused]] const ssize_t taken =
        ::send(descriptor(), data.data(), data.size(), MSG_DONTWAIT);
  }

 private:
  /// About as much as a serial port's 4 KiB, in states: the kernel doubles this, and counts some
  /// 770 bytes for a write of 49. With less, a host that is busy for a moment loses states; with
  /// more, a host that was stopped reads states that are seconds old.
  static constexpr int kSendBuffer = 32 * 1024;

  bool ended_ = false;
};

}  // namespace wheelwire::sim
