#include "board_rules.hpp"

#include "crc32.hpp"

namespace wheelwire {

namespace {

constexpr size_t kCrcSize = sizeof(uint32_t);

}  // namespace

void write_board(const BoardDescription& board, uint8_t* out) {
  board.encode(out);
  uint8_t* end = out + BoardDescription::kSize - kCrcSize;
  wire::put(end, crc32(out, BoardDescription::kSize - kCrcSize));
}

uint32_t fingerprint(const BoardDescription& board) {
  uint8_t packed[BoardDescription::kSize];
  board.encode(packed);
  return crc32(packed, BoardDescription::kSize - kCrcSize);
}

BoardFault read_board(const uint8_t* data, size_t size, BoardDescription& out) {
  if (size != BoardDescription::kSize || crc32(data, size) != kCrcResidue)
    return BoardFault::kDamaged;
  out = BoardDescription::decode(data);
  return BoardFault::kNone;
}

}  // namespace wheelwire
