#include "pty_port.hpp"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "baud.hpp"

namespace wheelwire::sim {

namespace {

constexpr auto kReaderTimeout = std::chrono::seconds(1);

int checked(int result, const char* action) {
  if (result < 0) {
    throw std::runtime_error(std::string("cannot ") + action + ": " + std::strerror(errno));
  }
  return result;
}

Descriptor open_master() {
  Descriptor master(checked(::posix_openpt(O_RDWR | O_NOCTTY), "open a pseudo-terminal"));
  checked(::grantpt(master.get()), "use the pseudo-terminal");
  checked(::unlockpt(master.get()), "unlock the pseudo-terminal");
  checked(::fcntl(master.get(), F_SETFL, O_NONBLOCK), "set up the pseudo-terminal");
  checked(::fcntl(master.get(), F_SETFD, FD_CLOEXEC), "set up the pseudo-terminal");
  return master;
}

Descriptor open_slave(const std::string& name) {
  Descriptor slave(
      checked(::open(name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC), "open the pseudo-terminal"));
  termios settings{};
  checked(::tcgetattr(slave.get(), &settings), "read the pseudo-terminal's settings");
  ::cfmakeraw(&settings);
  checked(::tcsetattr(slave.get(), TCSANOW, &settings), "make the pseudo-terminal raw");
  return slave;
}

}  // namespace

PtyPort::PtyPort(const std::string& link)
    : master_(open_master()), name_(::ptsname(master_.get())), slave_(open_slave(name_)) {
  if (!link.empty()) link_.emplace(link, name_);
}

uint32_t PtyPort::host_baud() const { return baud_of(slave_.get()); }

Bytes PtyPort::read() {
  Bytes data(4096);
  const ssize_t count = ::read(master_.get(), data.data(), data.size());
  data.resize(count > 0 ? static_cast<size_t>(count) : 0);
  if (!data.empty()) last_activity_ = Clock::now();
  return data;
}

void PtyPort::write(const Bytes& data) {
  const Clock::time_point now = Clock::now();
  // Avoids a system call per write, which would delay answers.
  const bool in_doubt = now - last_activity_ > kReaderTimeout / 2;
  if (in_doubt) check_reader(now);
  // A full pseudo-terminal takes what fits; the rest is lost, as on a serial port.
  [[maybe_unused]] const ssize_t taken = ::write(master_.get(), data.data(), data.size());
  if (in_doubt) unread_ = unread();
}

void PtyPort::check_reader(Clock::time_point now) {
  const size_t unread_now = unread();
  if (unread_now == 0 || unread_now < unread_) last_activity_ = now;
  if (now - last_activity_ > kReaderTimeout) ::tcflush(slave_.get(), TCIFLUSH);
}

size_t PtyPort::unread() const {
  int count = 0;
  return ::ioctl(slave_.get(), FIONREAD, &count) == 0 ? static_cast<size_t>(count) : 0;
}

}  // namespace wheelwire::sim
