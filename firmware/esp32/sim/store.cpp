#include "store.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

namespace wheelwire::sim {

namespace {

constexpr std::string_view kHeader = "WWS3";
/// A slot in the storage is the size of its content, and room for it.
constexpr size_t kSlotRoom = 1024;

void append_slot(Bytes& file, const Bytes& slot) {
  const size_t end = file.size() + kSlotRoom;
  file.push_back(static_cast<uint8_t>(slot.size()));
  file.push_back(static_cast<uint8_t>(slot.size() >> 8));
  file.insert(file.end(), slot.begin(), slot.end());
  file.resize(end);
}

/// Where it is damaged, bytes that no slot holds.
Bytes slot_of(const Bytes& file, size_t number) {
  const size_t at = kHeader.size() + number * kSlotRoom;
  if (at + kSlotRoom > file.size()) return Bytes(1);
  const size_t size = file[at] | static_cast<size_t>(file[at + 1]) << 8;
  const auto first = file.begin() + static_cast<std::ptrdiff_t>(at + 2);
  return Bytes(first, first + static_cast<std::ptrdiff_t>(std::min(size, kSlotRoom - 2)));
}

}  // namespace

void Store::keep_in(std::unique_ptr<Storage> storage) {
  const Bytes file = storage->read();
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  const bool has_slots = text.starts_with(kHeader);
  if (has_slots) {
    first_.put(slot_of(file, 0));
    second_.put(slot_of(file, 1));
  } else if (!file.empty()) {
    first_.put(file);  // Of an earlier release, or damaged.
  }
  storage_ = std::move(storage);
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
  put();
}

/// Deletes the block.
bool Store::clear() {
  unreadable = 0;
  first_.put({});
  second_.put({});
  return put();
}

bool Store::put() const {
  if (!storage_) return true;
  if (first_.bytes().empty() && second_.bytes().empty()) return storage_->replace({});
  Bytes file(kHeader.begin(), kHeader.end());
  append_slot(file, first_.bytes());
  append_slot(file, second_.bytes());
  return storage_->replace(file);
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
  if (store_.put()) return fate == WriteFate::kDone;
  bytes_.swap(bytes);
  return false;
}

size_t RetainedMemory::load(uint8_t* out, size_t capacity) {
  std::copy_n(bytes_.begin(), std::min(capacity, bytes_.size()), out);
  return bytes_.size();
}

}  // namespace wheelwire::sim
