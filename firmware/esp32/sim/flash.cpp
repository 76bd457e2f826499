#include "flash.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>

namespace wheelwire::sim {

Flash::~Flash() {
  if (file_ >= 0) ::close(file_);
}

void Flash::use_file(const std::string& path) {
  path_ = path;
  std::ifstream file(path, std::ios::binary);
  // If the file is too short, the rest is as erased.
  if (file)
    file.read(reinterpret_cast<char*>(bytes_.data()), static_cast<std::streamsize>(bytes_.size()));
}

bool Flash::read(uint32_t offset, uint8_t* out, size_t size) {
  std::copy_n(bytes_.begin() + offset, size, out);
  return true;
}

bool Flash::write(uint32_t offset, const uint8_t* data, size_t size) {
  if (watch != nullptr) watch->on_flash();
  for (size_t i = 0; i < size; ++i) bytes_[offset + i] &= data[i];
  return put(offset, size);
}

bool Flash::erase(uint32_t offset) {
  if (watch != nullptr) watch->on_flash();
  std::fill_n(bytes_.begin() + offset, kFlashSector, uint8_t{0xff});
  return put(offset, kFlashSector);
}

/// In place: a program that dies in the middle leaves a part, as flash does when the power goes.
bool Flash::put(size_t offset, size_t size) {
  if (path_.empty()) return true;
  if (file_ < 0) {
    file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (file_ < 0) return false;
    offset = 0;
    size = bytes_.size();
  }
  while (size > 0) {
    const ssize_t written =
        ::pwrite(file_, bytes_.data() + offset, size, static_cast<off_t>(offset));
    if (written < 0 && errno != EINTR) return false;
    if (written < 0) continue;
    offset += static_cast<size_t>(written);
    size -= static_cast<size_t>(written);
  }
  return true;
}

}  // namespace wheelwire::sim
