#include "box_image.hpp"

#include "crc32.hpp"

namespace wheelwire {
namespace {

constexpr uint32_t kImageMagic = 0x49425757;  // "WWBI"
constexpr uint32_t kFormat = 1;
constexpr size_t kUsedWords = 13;

uint32_t crc32_of(const uint32_t* words, size_t count) {
  return crc32(reinterpret_cast<const uint8_t*>(words), count * sizeof *words);
}

}  // namespace

void BoxHead::encode(uint32_t* out) const {
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

bool BoxHead::decode(const uint32_t* words, BoxHead& out) {
  if (words[0] != kImageMagic || (words[1] & 0xff) != kFormat) return false;
  if (crc32_of(words, kUsedWords - 1) != words[kUsedWords - 1]) return false;
  out = {
      .cause = static_cast<BoxCause>(words[1] >> 8),
      .reset_reason = static_cast<ResetReason>(words[1] >> 16),
      .number = words[2],
      .origin = {.core = words[4], .release = words[5], .git_hash = words[6], .boot_id = words[3]},
      .board = words[7],
      .faults = words[8],
      .stored_us = words[9] | static_cast<uint64_t>(words[10]) << 32,
      .check = words[11]};
  return true;
}

uint32_t box_check(const uint32_t* memory) { return crc32_of(memory, box::kWords); }

}  // namespace wheelwire
