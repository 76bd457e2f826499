#include "socket_port.hpp"

#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace wheelwire::sim {

namespace {

/// About as much as a serial port's 4 KiB, in states: the kernel doubles this, and counts some 770
/// bytes for a write of 49. With less, a host that is busy for a moment loses states; with more, a
/// host that was stopped reads states that are seconds old.
constexpr int kSendBuffer = 32 * 1024;

}  // namespace

SocketPort::SocketPort(int fd) : socket_(fd), name_("socket " + std::to_string(fd)) {
  if (::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &kSendBuffer, sizeof kSendBuffer) != 0) {
    throw std::runtime_error("cannot use " + name_ + ": " + std::strerror(errno));
  }
}

Bytes SocketPort::read() {
  Bytes data(4096);
  const ssize_t count = ::recv(socket_.get(), data.data(), data.size(), MSG_DONTWAIT);
  ended_ = count == 0 || (count < 0 && errno != EAGAIN && errno != EINTR);
  data.resize(count > 0 ? static_cast<size_t>(count) : 0);
  return data;
}

void SocketPort::write(const Bytes& data) {
  [[maybe_unused]] const ssize_t taken =
      ::send(socket_.get(), data.data(), data.size(), MSG_DONTWAIT);
}

}  // namespace wheelwire::sim
