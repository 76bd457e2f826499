// Saved data, in files that outlast the program.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <memory>
#include <string>

#include "board.hpp"
#include "storage.hpp"

namespace wheelwire::sim {

class File final : public Storage {
 public:
  explicit File(std::string path) : path_(std::move(path)) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  ~File() override {
    if (descriptor_ >= 0) ::close(descriptor_);
  }

  Bytes read() override {
    Bytes bytes;
    const int descriptor = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return bytes;
    uint8_t part[4096];
    for (;;) {
      const ssize_t size = ::read(descriptor, part, sizeof part);
      if (size < 0 && errno == EINTR) continue;
      if (size <= 0) break;
      bytes.insert(bytes.end(), part, part + size);
    }
    ::close(descriptor);
    return bytes;
  }

  bool write(size_t offset, const uint8_t* data, size_t size) override {
    if (descriptor_ < 0) descriptor_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    return descriptor_ >= 0 && write_all(descriptor_, offset, data, size);
  }

  bool replace(const Bytes& bytes) override {
    if (bytes.empty()) return ::unlink(path_.c_str()) == 0 || errno == ENOENT;
    const std::string fresh = path_ + ".new";
    const int descriptor = ::open(fresh.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (descriptor < 0) return false;
    const bool written =
        write_all(descriptor, 0, bytes.data(), bytes.size()) && ::fsync(descriptor) == 0;
    const bool closed = ::close(descriptor) == 0;
    if (written && closed && std::rename(fresh.c_str(), path_.c_str()) == 0) return true;
    ::unlink(fresh.c_str());
    return false;
  }

 private:
  static bool write_all(int descriptor, size_t offset, const uint8_t* data, size_t size) {
    while (size > 0) {
      const ssize_t written = ::pwrite(descriptor, data, size, static_cast<off_t>(offset));
      if (written < 0 && errno != EINTR) return false;
      if (written < 0) continue;
      data += written;
      offset += static_cast<size_t>(written);
      size -= static_cast<size_t>(written);
    }
    return true;
  }

  std::string path_;
  int descriptor_ = -1;  ///< For what is written in place.
};

/// Stores the parameters in this file. The board, its peripherals, a latched e-stop and the
/// recorder's data go to files next to it.
inline void use_files(SimulatedBoard& board, const std::string& path) {
  board.store.keep_in(std::make_unique<File>(path));
  board.configuration_store.keep_in(std::make_unique<File>(path + ".board"));
  board.latch_store.keep_in(std::make_unique<File>(path + ".latch"));
  board.recorder_flash.keep_in(std::make_unique<File>(path + ".recorder"));
}

}  // namespace wheelwire::sim
