// The least that can answer on a pseudo-terminal: what comes in goes out. Prints the port's name,
// and ends with its standard input.
#define _GNU_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

static int open_terminal(void) {
  const int master = posix_openpt(O_RDWR | O_NOCTTY);
  if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) return -1;
  // Held open: a host that closes the port must not hang it up.
  const int slave = open(ptsname(master), O_RDWR | O_NOCTTY);
  struct termios settings;
  if (slave < 0 || tcgetattr(slave, &settings) != 0) return -1;
  cfmakeraw(&settings);
  return tcsetattr(slave, TCSANOW, &settings) == 0 ? master : -1;
}

int main(void) {
  const int master = open_terminal();
  if (master < 0) {
    perror("echo");
    return 1;
  }
  puts(ptsname(master));
  fflush(stdout);
  struct pollfd ready[] = {{.fd = STDIN_FILENO, .events = POLLIN},
                           {.fd = master, .events = POLLIN}};
  char data[4096];
  while (poll(ready, 2, -1) > 0 && ready[0].revents == 0) {
    const ssize_t size = read(master, data, sizeof data);
    if (size > 0 && write(master, data, (size_t)size) != size) return 1;
  }
  return 0;
}
