#include "socket_port.hpp"

#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace wheelwire::sim {

SocketPort::SocketPort(int fd) : socket_(fd), name_("socket " + std::to_string(fd)) {
  // States that the host does not read must not go stale in a queue.
  const int least = 0;
  if (::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &least, sizeof least) != 0) {
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
