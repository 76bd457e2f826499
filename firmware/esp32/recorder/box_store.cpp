#include "box_store.hpp"

#include <string.h>

namespace wheelwire {
namespace {

constexpr uint32_t kMemorySize = static_cast<uint32_t>(box::kWords * sizeof(uint32_t));
constexpr auto kHeadSize = static_cast<uint32_t>(BoxHead::kSize);

/// Wraps after 2^32 boxes.
bool is_newer(const BoxHead& a, const BoxHead& b) {
  return static_cast<int32_t>(a.number - b.number) > 0;
}

}  // namespace

void BoxStore::start() {
  uint32_t words[BoxHead::kWords];
  for (size_t i = 0; i < kSlots; ++i) {
    auto* const bytes = reinterpret_cast<uint8_t*>(words);
    slots_[i].is_valid =
        flash_.read(start_of(i), bytes, sizeof words) && BoxHead::decode(words, slots_[i].head);
  }
  choose_spare();
}

size_t BoxStore::count() const {
  size_t found = 0;
  for (const Slot& slot : slots_) found += slot.is_valid ? 1 : 0;
  return found;
}

const BoxHead* BoxStore::head(size_t age) const {
  // The one with so many newer ones.
  for (const Slot& slot : slots_) {
    if (!slot.is_valid) continue;
    size_t newer = 0;
    for (const Slot& other : slots_)
      if (other.is_valid && is_newer(other.head, slot.head)) ++newer;
    if (newer == age) return &slot.head;
  }
  return nullptr;
}

size_t BoxStore::read(uint32_t number, uint32_t offset, uint8_t* out, size_t capacity) {
  if (offset >= kBoxImageSize) return 0;
  const size_t size = capacity < kBoxImageSize - offset ? capacity : kBoxImageSize - offset;
  for (size_t i = 0; i < kSlots; ++i)
    if (slots_[i].is_valid && slots_[i].head.number == number)
      return flash_.read(start_of(i) + offset, out, size) ? size : 0;
  return 0;
}

/// Chooses an empty slot, or the oldest box of the most frequent cause. So eight presses of the
/// emergency stop do not replace a single panic.
void BoxStore::choose_spare() {
  blank_ = 0;
  is_erased_ = false;
  for (spare_ = 0; spare_ < kSlots; ++spare_)
    if (!slots_[spare_].is_valid) return;
  spare_ = oldest_of_most();
}

size_t BoxStore::oldest_of_most() const {
  size_t found = 0;
  size_t most = 0;
  for (size_t i = 0; i < kSlots; ++i) {
    size_t same = 0;
    for (const Slot& other : slots_) same += other.head.cause == slots_[i].head.cause ? 1 : 0;
    if (same < most || (same == most && !is_newer(slots_[found].head, slots_[i].head))) continue;
    found = i;
    most = same;
  }
  return found;
}

uint32_t BoxStore::begin(const BoxHead& head, const uint32_t* memory) {
  const BoxHead* const newest = this->head(0);
  head_ = head;
  head_.number = newest == nullptr ? 1 : newest->number + 1;
  head_.check = box_check(memory);
  memory_ = memory;
  written_ = 0;
  failed_ = 0;
  return head_.number;
}

bool BoxStore::work() {
  if (is_idle()) return false;
  return blank_ < kBoxImageSize ? prepare() : write_next();
}

/// The next part of the spare slot. The first sector has the head: it is gone before the rest is.
bool BoxStore::prepare() {
  slots_[spare_].is_valid = false;
  if (is_blank(start_of(spare_) + blank_)) {
    blank_ += kChunk;
    if (blank_ % kFlashSector == 0) is_erased_ = false;
    return false;
  }
  blank_ -= blank_ % kFlashSector;
  if (is_erased_ || !flash_.erase(start_of(spare_) + blank_)) {
    fail();
  } else {
    is_erased_ = true;
  }
  return true;
}

bool BoxStore::write_next() {
  const uint32_t start = start_of(spare_);
  if (written_ < kMemorySize) {
    const uint32_t rest = kMemorySize - written_;
    const uint32_t size = rest < kChunk ? rest : kChunk;
    const auto* const bytes = reinterpret_cast<const uint8_t*>(memory_);
    if (write_checked(start + kHeadSize + written_, bytes + written_, size))
      written_ += size;
    else
      fail();
    return true;
  }
  uint32_t words[BoxHead::kWords];
  head_.encode(words);
  if (write_checked(start, reinterpret_cast<const uint8_t*>(words), kHeadSize)) {
    slots_[spare_] = {.is_valid = true, .head = head_};
    memory_ = nullptr;
    failed_ = 0;
    choose_spare();
  } else {
    fail();
  }
  return true;
}

/// Flash that was written while the power failed may take a later write badly.
bool BoxStore::write_checked(uint32_t offset, const uint8_t* data, uint32_t size) {
  return flash_.write(offset, data, size) && flash_.read(offset, buffer_, size) &&
         memcmp(buffer_, data, size) == 0;
}

/// The slot is erased again. After kAttempts failures it gives up, and leaves the flash alone.
void BoxStore::fail() {
  blank_ = 0;
  is_erased_ = false;
  written_ = 0;
  if (++failed_ < kAttempts) return;
  is_broken_ = true;
  memory_ = nullptr;
}

/// kChunk bytes.
bool BoxStore::is_blank(uint32_t offset) {
  if (!flash_.read(offset, buffer_, sizeof buffer_)) return false;
  for (const uint8_t byte : buffer_)
    if (byte != 0xff) return false;
  return true;
}

}  // namespace wheelwire
