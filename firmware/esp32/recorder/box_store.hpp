// Black boxes in flash: eight of them, and room for the next one, which is erased in advance.
// A box is written to an empty slot, its head last. So a power cut leaves all old boxes, or these
// and the new one, and never part of a box. Then the slot for the next box is erased.
#pragma once

#include "box_image.hpp"
#include "flash_region.hpp"

namespace wheelwire {

class BoxStore {
 public:
  static constexpr size_t kSlots = 9;
  static constexpr uint32_t kSize = kSlots * kBoxImageSize;

  explicit BoxStore(FlashRegion& flash) : flash_(flash) {}

  /// Finds what is there. Only reads.
  void start();

  /// How many boxes there are.
  size_t count() const;
  /// The head of the box that was stored that many boxes ago, 0 for the newest; nullptr if there
  /// are not that many.
  const BoxHead* head(size_t age) const;
  /// Reads a part of a box, from `offset` on what there is; returns how many bytes.
  size_t read(uint32_t number, uint32_t offset, uint8_t* out, size_t capacity);

  /// Begins to store a box. The memory must not change before it is stored. Its number and check
  /// are filled in; returns the number.
  uint32_t begin(const BoxHead& head, const uint32_t* memory);
  bool is_storing() const { return memory_ != nullptr; }
  /// Whether nothing is left to do, or nothing can be done.
  bool is_idle() const { return is_broken_ || (blank_ == kBoxImageSize && memory_ == nullptr); }
  /// One step, or none if nothing is left to do: at most one erasure of a sector or one write of
  /// kChunk bytes, and one read of as many. Each of them holds up the processor; hosts get their
  /// answers between two steps. Returns whether it changed the flash.
  bool work();

 private:
  static constexpr uint32_t kChunk = 1024;
  static_assert(kFlashSector % kChunk == 0);
  static constexpr uint8_t kAttempts = 2;

  struct Slot {
    bool is_valid = false;
    BoxHead head;
  };

  void choose_spare();
  size_t oldest_of_most() const;
  bool prepare();
  bool write_next();
  bool write_checked(uint32_t offset, const uint8_t* data, uint32_t size);
  void fail();
  bool is_blank(uint32_t offset);
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
