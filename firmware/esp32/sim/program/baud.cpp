#include "baud.hpp"

// On Linux non-standard speeds need termios2, whose header cannot be included with termios.h.
#ifdef __linux__
#include <asm/termbits.h>
#include <sys/ioctl.h>
#else
#include <termios.h>
#endif

namespace wheelwire::sim {

uint32_t baud_of(int fd) {
#ifdef __linux__
  // TCGETS2, whose header conflicts with <sys/ioctl.h>.
  termios2 settings{};
  return ::ioctl(fd, _IOR('T', 0x2A, termios2), &settings) == 0 ? settings.c_ospeed : 0;
#else
  termios settings{};
  return ::tcgetattr(fd, &settings) == 0 ? static_cast<uint32_t>(::cfgetospeed(&settings)) : 0;
#endif
}

}  // namespace wheelwire::sim
