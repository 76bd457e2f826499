// The process that this one was started for.
#pragma once

#include <poll.h>
#ifdef __linux__
#include <sys/syscall.h>
#endif

#include <stdexcept>

#include "descriptor.hpp"

namespace wheelwire::sim {

class Parent {
 public:
  /// -1: none. Throws std::runtime_error when it has ended already.
  explicit Parent(int pid) : descriptor_(open_descriptor(pid)) {}
  /// Becomes readable when it ends; -1 where the system does not support that.
  int descriptor() const { return descriptor_.get(); }

  bool ended() const {
    if (descriptor() < 0) return false;
    pollfd watched{.fd = descriptor(), .events = POLLIN, .revents = 0};
    return ::poll(&watched, 1, 0) > 0;
  }

 private:
  /// A fork of the parent may hold its socket and pipes open, so their end of file is not enough.
  static int open_descriptor([[maybe_unused]] int pid) {
#ifdef SYS_pidfd_open
    if (pid >= 0) {
      const auto descriptor = static_cast<int>(::syscall(SYS_pidfd_open, pid, 0));
      if (descriptor < 0 || ::getppid() != pid) throw std::runtime_error("the parent has ended");
      return descriptor;
    }
#endif
    return -1;
  }

  Descriptor descriptor_;
};

}  // namespace wheelwire::sim
