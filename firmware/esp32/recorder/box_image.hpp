// A black box as it is stored: a head that says what it is of, then the recorder's memory.
#pragma once

#include "black_box.hpp"
#include "crc32.hpp"

namespace wheelwire {

inline uint32_t crc32_of(const uint32_t* words, size_t count) {
  return crc32(reinterpret_cast<const uint8_t*>(words), count * sizeof *words);
}

struct BoxHead {
  static constexpr size_t kWords = 64;
  static constexpr size_t kSize = kWords * sizeof(uint32_t);

  BoxCause cause = BoxCause::kRequest;
  /// Of the reset after which it was stored; of the present boot if it was before any.
  ResetReason reset_reason = ResetReason::kUnknown;
  uint32_t number = 0;  ///< Counts up over all boxes of a device.
  BoxOrigin origin{};
  uint32_t board = 0;  ///< Fingerprint; 0: none.
  uint32_t faults = 0;
  uint64_t stored_us = 0;  ///< Device clock.
  uint32_t check = 0;      ///< CRC-32 of the memory.

  /// Writes kWords.
  void encode(uint32_t* out) const {
    const uint32_t words[kUsedWords - 1] = {
        kImageMagic,
        kFormat | static_cast<uint32_t>(cause) << 8 | static_cast<uint32_t>(reset_reason) << 16,
        number,
        origin.boot_id,
        origin.core,
        origin.release,
        origin.git_hash,
        board,
        faults,
        static_cast<uint32_t>(stored_us),
        static_cast<uint32_t>(stored_us >> 32),
        check};
    for (size_t i = 0; i < kUsedWords - 1; ++i) out[i] = words[i];
    out[kUsedWords - 1] = crc32_of(out, kUsedWords - 1);
    for (size_t i = kUsedWords; i < kWords; ++i)
      out[i] = UINT32_MAX;  // As erased flash: room for more.
  }
  /// False if there is no head, or a damaged one.
  static bool decode(const uint32_t* words, BoxHead& out) {
    if (words[0] != kImageMagic || (words[1] & 0xff) != kFormat) return false;
    if (crc32_of(words, kUsedWords - 1) != words[kUsedWords - 1]) return false;
    out = {.cause = static_cast<BoxCause>(words[1] >> 8),
           .reset_reason = static_cast<ResetReason>(words[1] >> 16),
           .number = words[2],
           .origin = {.core = words[4],
                      .release = words[5],
                      .git_hash = words[6],
                      .boot_id = words[3]},
           .board = words[7],
           .faults = words[8],
           .stored_us = words[9] | static_cast<uint64_t>(words[10]) << 32,
           .check = words[11]};
    return true;
  }

 private:
  static constexpr uint32_t kImageMagic = 0x49425757;  // "WWBI"
  static constexpr uint32_t kFormat = 1;
  static constexpr size_t kUsedWords = 13;
};

constexpr size_t kBoxImageWords = BoxHead::kWords + box::kWords;
constexpr size_t kBoxImageSize = kBoxImageWords * sizeof(uint32_t);
static_assert(kBoxImageSize == 32 * 1024);

/// Of the recorder's memory.
inline uint32_t box_check(const uint32_t* memory) { return crc32_of(memory, box::kWords); }

}  // namespace wheelwire
