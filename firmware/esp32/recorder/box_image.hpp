// A black box as it is stored: a head that says what it is of, then the recorder's memory.
#pragma once

#include "black_box.hpp"
#include "protocol.hpp"

namespace wheelwire {

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
  void encode(uint32_t* out) const;
  /// False if there is no head, or a damaged one.
  static bool decode(const uint32_t* words, BoxHead& out);
};

constexpr size_t kBoxImageWords = BoxHead::kWords + box::kWords;
constexpr size_t kBoxImageSize = kBoxImageWords * sizeof(uint32_t);
static_assert(kBoxImageSize == 32 * 1024);

/// Of the recorder's memory.
uint32_t box_check(const uint32_t* memory);

}  // namespace wheelwire
