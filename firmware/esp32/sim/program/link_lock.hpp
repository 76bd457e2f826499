// A link's path belongs to one simulator at a time, even while its port is unplugged.
#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

#include "descriptor.hpp"

namespace wheelwire::sim {

class LinkLock {
 public:
  /// Locks `link`.lock, which holds this process's id. The kernel unlocks it however the process
  /// ends. Throws std::runtime_error, which names the other process, if one holds it.
  explicit LinkLock(const std::string& link) : path_(link + ".lock"), file_(lock(path_, link)) {
    const std::string pid = std::to_string(::getpid());
    [[maybe_unused]] const int emptied = ::ftruncate(file_.get(), 0);
    [[maybe_unused]] const ssize_t written = ::pwrite(file_.get(), pid.data(), pid.size(), 0);
  }

  LinkLock(const LinkLock&) = delete;
  LinkLock& operator=(const LinkLock&) = delete;
  ~LinkLock() { ::unlink(path_.c_str()); }

 private:
  static std::string holder(int file) {
    char pid[16] = {};
    const ssize_t size = ::pread(file, pid, sizeof pid - 1, 0);
    return size > 0 ? " (process " + std::string(pid) + ")" : "";
  }

  static bool is_at(int file, const std::string& path) {
    struct stat opened{};
    struct stat there{};
    return ::fstat(file, &opened) == 0 && ::stat(path.c_str(), &there) == 0 &&
           opened.st_dev == there.st_dev && opened.st_ino == there.st_ino;
  }

  static Descriptor lock(const std::string& path, const std::string& link) {
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

  std::string path_;
  Descriptor file_;
};

}  // namespace wheelwire::sim
