// The host's end of the line: a pseudo-terminal that behaves like a USB serial port.
#pragma once

#include <fcntl.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>

#include "baud.hpp"
#include "descriptor.hpp"
#include "host_port.hpp"
#include "link_file.hpp"

namespace wheelwire::sim {

class PtyPort final : public HostPort {
 public:
  /// Opens a pseudo-terminal in raw mode, and the link to it if `link` is not empty. Throws
  /// std::runtime_error.
  explicit PtyPort(const std::string& link) : PtyPort(open_master()) {
    if (!link.empty()) link_.emplace(link, name());
  }

  uint32_t host_baud() const override { return baud_of(slave_.get()); }

  Bytes read() override {
    Bytes data(4096);
    const ssize_t count = ::read(descriptor(), data.data(), data.size());
    data.resize(count > 0 ? static_cast<size_t>(count) : 0);
    if (!data.empty()) last_activity_ = Clock::now();
    return data;
  }

  /// What does not fit is lost. Without a reader only the latest write is buffered: a closed serial
  /// port buffers nothing, either.
  void write(const Bytes& data) override {
    const Clock::time_point now = Clock::now();
    // Avoids a system call per write, which would delay answers.
    const bool in_doubt = now - last_activity_ > kReaderTimeout / 2;
    if (in_doubt) check_reader(now);
    // A full pseudo-terminal takes what fits; the rest is lost, as on a serial port.
    [[maybe_unused]] const ssize_t taken = ::write(descriptor(), data.data(), data.size());
    if (in_doubt) unread_ = unread();
  }

 private:
  using Clock = std::chrono::steady_clock;
  explicit PtyPort(Descriptor master)
      : HostPort(std::move(master), ::ptsname(master.get())), slave_(open_slave(name())) {}

  static constexpr auto kReaderTimeout = std::chrono::seconds(1);

  static int checked(int result, const char* action) {
    if (result < 0) {
      throw std::runtime_error(std::string("cannot ") + action + ": " + std::strerror(errno));
    }
    return result;
  }

  static Descriptor open_master() {
    Descriptor master(checked(::posix_openpt(O_RDWR | O_NOCTTY), "open a pseudo-terminal"));
    checked(::grantpt(master.get()), "use the pseudo-terminal");
    checked(::unlockpt(master.get()), "unlock the pseudo-terminal");
    checked(::fcntl(master.get(), F_SETFL, O_NONBLOCK), "set up the pseudo-terminal");
    checked(::fcntl(master.get(), F_SETFD, FD_CLOEXEC), "set up the pseudo-terminal");
    return master;
  }

  static Descriptor open_slave(const std::string& name) {
    Descriptor slave(
        checked(::open(name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC), "open the pseudo-terminal"));
    termios settings{};
    checked(::tcgetattr(slave.get(), &settings), "read the pseudo-terminal's settings");
    ::cfmakeraw(&settings);
    checked(::tcsetattr(slave.get(), TCSANOW, &settings), "make the pseudo-terminal raw");
    return slave;
  }

  void check_reader(Clock::time_point now) {
    const size_t unread_now = unread();
    if (unread_now == 0 || unread_now < unread_) last_activity_ = now;
    if (now - last_activity_ > kReaderTimeout) ::tcflush(slave_.get(), TCIFLUSH);
  }

  size_t unread() const {
    int count = 0;
    return ::ioctl(slave_.get(), FIONREAD, &count) == 0 ? static_cast<size_t>(count) : 0;
  }

  Descriptor slave_;  ///< Held open: a host that closes the port must not hang it up.
  std::optional<LinkFile> link_;
  size_t unread_ = 0;                               ///< After the last write that was in doubt.
  Clock::time_point last_activity_ = Clock::now();  ///< When the host last read or wrote.
};

}  // namespace wheelwire::sim
