#include "link_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace wheelwire::sim {

namespace {

std::string holder(int file) {
  char pid[16] = {};
  const ssize_t size = ::pread(file, pid, sizeof pid - 1, 0);
  return size > 0 ? " (process " + std::string(pid) + ")" : "";
}

bool is_at(int file, const std::string& path) {
  struct stat opened{};
  struct stat there{};
  return ::fstat(file, &opened) == 0 && ::stat(path.c_str(), &there) == 0 &&
         opened.st_dev == there.st_dev && opened.st_ino == there.st_ino;
}

Descriptor lock(const std::string& path, const std::string& link) {
  for (;;) {
    Descriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
    if (file.get() < 0)
      throw std::runtime_error("cannot make " + path + ": " + std::strerror(errno));
    if (::flock(file.get(), LOCK_EX | LOCK_NB) < 0) {
      throw std::runtime_error(link + " is the port of another simulator" + holder(file.get()) +
                               " that is running: use that one, end it, or give another --link");
    }
    // The previous holder may have removed the file after it was opened here and before it was
    // locked.
    if (is_at(file.get(), path)) return file;
  }
}

}  // namespace

LinkLock::LinkLock(const std::string& link) : path_(link + ".lock"), file_(lock(path_, link)) {
  const std::string pid = std::to_string(::getpid());
  [[maybe_unused]] const int emptied = ::ftruncate(file_.get(), 0);
  [[maybe_unused]] const ssize_t written = ::pwrite(file_.get(), pid.data(), pid.size(), 0);
}

LinkLock::~LinkLock() { ::unlink(path_.c_str()); }

}  // namespace wheelwire::sim
