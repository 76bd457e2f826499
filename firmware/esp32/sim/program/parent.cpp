#include "parent.hpp"

#include <poll.h>
#ifdef __linux__
#include <sys/syscall.h>
#endif

#include <stdexcept>

namespace wheelwire::sim {

namespace {

/// A fork of the parent may hold its socket and pipes open, so their end of file is not enough.
int open_descriptor([[maybe_unused]] int pid) {
#ifdef SYS_pidfd_open
  if (pid >= 0) {
    const auto descriptor = static_cast<int>(::syscall(SYS_pidfd_open, pid, 0));
    if (descriptor < 0 || ::getppid() != pid) throw std::runtime_error("the parent has ended");
    return descriptor;
  }
#endif
  return -1;
}

}  // namespace

Parent::Parent(int pid) : descriptor_(open_descriptor(pid)) {}

bool Parent::ended() const {
  if (descriptor() < 0) return false;
  pollfd watched{.fd = descriptor(), .events = POLLIN, .revents = 0};
  return ::poll(&watched, 1, 0) > 0;
}

}  // namespace wheelwire::sim
