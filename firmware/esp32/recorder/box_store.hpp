// Black boxes in flash: eight of them, and room for the next one, which is erased in advance.
// A box is written to an empty slot, its head last. So a power cut leaves all old boxes, or these
// and the new one, and never part of a box. Then the slot for the next box is erased.
#pragma once

#include <string.h>

#include "box_image.hpp"
#include "flash_region.hpp"

namespace wheelwire {

class BoxStore {
 public:
  static constexpr size_t kSlots = 9;
  static constexpr uint32_t kSize = kSlots * kBoxImageSize;

  explicit BoxStore(FlashRegion& flash) : flash_(flash) {}

  /// Finds what is there. Only reads.
  void start() {
    uint32_t words[BoxHead::kWords];
    for (size_t i = 0; i < kSlots; ++i) {
      auto* const bytes = reinterpret_cast<uint8_t*>(words);
      slots_[i].is_valid =
          flash_.read(start_of(i), bytes, sizeof words) && BoxHead::decode(words, slots_[i].head);
    }
    choose_spare();
  }

  /// How many boxes there are.
  size_t count() const {
    size_t found = 0;
    for (const Slot& slot : slots_) found += slot.is_valid ? 1 : 0;
    return found;
  }
  /// The head of the box that was stored that many boxes ago, 0 for the newest; nullptr if there
  /// are not that many.
  const BoxHead* head(size_t age) const {
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
  /// Reads a part of a box, from `offset` on what there is; returns how many bytes.
  size_t read(uint32_t number, uint32_t offset, uint8_t* out, size_t capacity) {
    if (offset >= kBoxImageSize) return 0;
    const size_t size = capacity < kBoxImageSize - offset ? capacity : kBoxImageSize - offset;
    for (size_t i = 0; i < kSlots; ++i)
      if (slots_[i].is_valid && slots_[i].head.number == number)
        return flash_.read(start_of(i) + offset, out, size) ? size : 0;
    return 0;
  }

  /// Begins to store a box. The memory must not change before it is stored. Its number and check
  /// are filled in; returns the number.
  uint32_t begin(const BoxHead& head, const uint32_t* memory) {
    const BoxHead* const newest = this->head(0);
    head_ = head;
    head_.number = newest == nullptr ? 1 : newest->number + 1;
    head_.check = box_check(memory);
    memory_ = memory;
    written_ = 0;
    failed_ = 0;
    return head_.number;
  }
  bool is_storing() const { return memory_ != nullptr; }
  /// Whether nothing is left to do, or nothing can be done.
  bool is_idle() const { return is_broken_ || (blank_ == kBoxImageSize && memory_ == nullptr); }
  /// One step, or none if nothing is left to do: at most one erasure of a sector or one write of
  /// kChunk bytes, and one read of as many. Each of them holds up the processor; hosts get their
  /// answers between two steps. Returns whether it changed the flash.
  bool work() {
    if (is_idle()) return false;
    return blank_ < kBoxImageSize ? prepare() : write_next();
  }

 private:
  static constexpr uint32_t kMemorySize = static_cast<uint32_t>(box::kWords * sizeof(uint32_t));

  static constexpr auto kHeadSize = static_cast<uint32_t>(BoxHead::kSize);

  /// Wraps after 2^32 boxes.
  static bool is_newer(const BoxHead& a, const BoxHead& b) {
    return static_cast<int32_t>(a.number - b.number) > 0;
  }

  static constexpr uint32_t kChunk = 1024;
  static_assert(kFlashSector % kChunk == 0);
  static constexpr uint8_t kAttempts = 2;

  struct Slot {
    bool is_valid = false;
    BoxHead head;
  };

  /// Chooses an empty slot, or the oldest box of the most frequent cause. So eight presses of the
  /// emergency stop do not replace a single panic.
  void choose_spare() {
    blank_ = 0;
    is_erased_ = false;
    for (spare_ = 0; spare_ < kSlots; ++spare_)
      if (!slots_[spare_].is_valid) return;
    spare_ = oldest_of_most();
  }
  size_t oldest_of_most() const {
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
  /// The next part of the spare slot. The first sector has the head: it is gone before the rest is.
  bool prepare() {
    slots_[spare_].is_valid = false;
    if (is_blank(flash_, start_of(spare_) + blank_, buffer_, sizeof buffer_)) {
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
  bool write_next() {
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
  bool write_checked(uint32_t offset, const uint8_t* data, uint32_t size) {
    return flash_.write(offset, data, size) && flash_.read(offset, buffer_, size) &&
           memcmp(buffer_, data, size) == 0;
  }
  /// The slot is erased again. After kAttempts failures it gives up, and leaves the flash alone.
  void fail() {
    blank_ = 0;
    is_erased_ = false;
    written_ = 0;
    if (++failed_ < kAttempts) return;
    is_broken_ = true;
    memory_ = nullptr;
  }
  uint32_t start_of(size_t slot) const { return static_cast<uint32_t>(slot * kBoxImageSize); }

  FlashRegion& flash_;
  Slot slots_[kSlots];
  size_t spare_ = 0;
  uint32_t blank_ = 0;      // Bytes of the spare slot that are known to be erased.
  bool is_erased_ = false;  // The sector behind them was erased, and is read back.
  BoxHead head_;
  const uint32_t* memory_ = nullptr;  // Of the box that is being stored.
  uint32_t written_ = 0;              // Bytes of it.
  uint8_t failed_ = 0;                // Attempts.
  bool is_broken_ = false;            // This flash takes nothing more until the next start.
  uint8_t buffer_[kChunk];
};

}  // namespace wheelwire
