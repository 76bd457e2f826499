#include "store.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <iterator>

namespace wheelwire::sim {

namespace {

Bytes read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return Bytes(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

bool write_all(int fd, const uint8_t* data, size_t size) {
  while (size > 0) {
    const ssize_t written = ::write(fd, data, size);
    if (written < 0 && errno != EINTR) return false;
    if (written < 0) continue;
    data += written;
    size -= static_cast<size_t>(written);
  }
  return true;
}

/// The file holds the old block or the new one, whenever the program dies.
bool replace_file(const std::string& path, const uint8_t* data, size_t size) {
  const std::string fresh = path + ".new";
  const int fd = ::open(fresh.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return false;
  const bool written = write_all(fd, data, size) && ::fsync(fd) == 0;
  const bool closed = ::close(fd) == 0;
  if (written && closed && std::rename(fresh.c_str(), path.c_str()) == 0) return true;
  ::unlink(fresh.c_str());
  return false;
}

}  // namespace

size_t Store::load(uint8_t* out, size_t capacity) {
  if ((unreadable | partition_faults()) != 0) return 0;
  if (!path_) return twin_.load(out, capacity);
  const Bytes block = read_file(*path_);
  std::copy_n(block.begin(), std::min(capacity, block.size()), out);
  return block.size();
}

bool Store::save(const uint8_t* data, size_t size) {
  if (partition_faults() != 0) return false;
  if (!path_) return twin_.save(data, size);
  return fate() == WriteFate::kDone && replace_file(*path_, data, size);
}

bool Store::erase() {
  if (partition_faults() == 0 && !path_) {
    if (!twin_.erase()) return false;
    unreadable = 0;
    return true;
  }
  if (fate() != WriteFate::kDone) return false;
  if (partition_faults() == 0) return format();
  partition_->faults = 0;
  bool formatted = true;
  for (Store* const store : partition_->stores) formatted = store->format() && formatted;
  return formatted;
}

/// Nothing is left of it.
bool Store::format() {
  unreadable = 0;
  first_.format();
  second_.format();
  return !path_ || ::unlink(path_->c_str()) == 0 || errno == ENOENT;
}

size_t Store::Slot::load(uint8_t* out, size_t capacity) {
  std::copy_n(bytes_.begin(), std::min(capacity, bytes_.size()), out);
  return bytes_.size();
}

bool Store::Slot::save(const uint8_t* data, size_t size) {
  const WriteFate fate = store_.fate();
  if (fate == WriteFate::kDone) bytes_.assign(data, data + size);
  if (fate == WriteFate::kLost) bytes_.clear();
  return fate == WriteFate::kDone;
}

bool Store::Slot::erase() {
  const WriteFate fate = store_.fate();
  if (fate != WriteFate::kUntouched) bytes_.clear();
  return fate == WriteFate::kDone;
}

size_t RetainedMemory::load(uint8_t* out, size_t capacity) {
  std::copy_n(bytes_.begin(), std::min(capacity, bytes_.size()), out);
  return bytes_.size();
}

}  // namespace wheelwire::sim
