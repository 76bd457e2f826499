#include "store.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string_view>

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

constexpr std::string_view kHeader = "WWS3";
/// In the file: the size of what the slot holds, and room for it.
constexpr size_t kSlotRoom = 1024;

void append_slot(Bytes& file, const Bytes& slot) {
  const size_t end = file.size() + kSlotRoom;
  file.push_back(static_cast<uint8_t>(slot.size()));
  file.push_back(static_cast<uint8_t>(slot.size() >> 8));
  file.insert(file.end(), slot.begin(), slot.end());
  file.resize(end);
}

/// Where the file is damaged, bytes that no slot holds.
Bytes slot_of(const Bytes& file, size_t number) {
  const size_t at = kHeader.size() + number * kSlotRoom;
  if (at + kSlotRoom > file.size()) return Bytes(1);
  const size_t size = file[at] | static_cast<size_t>(file[at + 1]) << 8;
  const auto first = file.begin() + static_cast<std::ptrdiff_t>(at + 2);
  return Bytes(first, first + static_cast<std::ptrdiff_t>(std::min(size, kSlotRoom - 2)));
}

}  // namespace

void Store::use_file(const std::string& path) {
  const Bytes file = read_file(path);
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  const bool has_slots = text.starts_with(kHeader);
  if (has_slots) {
    first_.put(slot_of(file, 0));
    second_.put(slot_of(file, 1));
  } else if (!file.empty()) {
    first_.put(file);  // Of an earlier release, or damaged.
  }
  path_ = path;
}

size_t Store::load(uint8_t* out, size_t capacity) {
  return (unreadable | partition_faults()) != 0 ? 0 : twin_.load(out, capacity);
}

bool Store::save(const uint8_t* data, size_t size) {
  if (partition_faults() != 0 || !twin_.save(data, size)) return false;
  unreadable = 0;
  return true;
}

bool Store::format() {
  if (partition_faults() == 0) return true;
  if (fate(StoreWatch::kFormat) != WriteFate::kDone) return false;
  partition_->faults = 0;
  bool is_clear = true;
  for (Store* const store : partition_->stores) is_clear = store->clear() && is_clear;
  return is_clear;
}

void Store::damage(Damage what) {
  if (what != Damage::kSecond) first_.put({});
  if (what != Damage::kFirst) second_.put({});
  write_file();
}

/// Nothing is left of it.
bool Store::clear() {
  unreadable = 0;
  first_.put({});
  second_.put({});
  return write_file();
}

bool Store::write_file() const {
  if (!path_) return true;
  if (first_.bytes().empty() && second_.bytes().empty())
    return ::unlink(path_->c_str()) == 0 || errno == ENOENT;
  Bytes file(kHeader.begin(), kHeader.end());
  append_slot(file, first_.bytes());
  append_slot(file, second_.bytes());
  return replace_file(*path_, file.data(), file.size());
}

size_t Store::Slot::load(uint8_t* out, size_t capacity) {
  std::copy_n(bytes_.begin(), std::min(capacity, bytes_.size()), out);
  return bytes_.size();
}

bool Store::Slot::save(const uint8_t* data, size_t size) {
  const WriteFate fate = store_.fate(this == &store_.first_ ? 0 : 1);
  if (fate == WriteFate::kUntouched) return false;
  Bytes bytes(data, data + size);
  if (fate == WriteFate::kLost) bytes.clear();
  bytes_.swap(bytes);
  if (store_.write_file()) return fate == WriteFate::kDone;
  bytes_.swap(bytes);
  return false;
}

size_t RetainedMemory::load(uint8_t* out, size_t capacity) {
  std::copy_n(bytes_.begin(), std::min(capacity, bytes_.size()), out);
  return bytes_.size();
}

}  // namespace wheelwire::sim
