// Frames from the bytes on the line, written from protocol/SPEC.md alone: the core's own decoder is
// under test.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include "protocol.hpp"

namespace wheelwire::explore {

/// A message on the wire that passed all checks.
struct Seen {
  uint8_t id = 0;
  std::vector<uint8_t> body;

  template <typename Message>
  Message as() const {
    return Message::decode(body.data());
  }
  bool operator==(const Seen&) const = default;
};

class WireDecoder {
 public:
  /// Calls `sink(Seen)` for each good frame that ends within these bytes.
  template <typename Sink>
  void feed(const uint8_t* data, size_t size, Sink&& sink) {
    for (size_t i = 0; i < size; ++i) {
      if (data[i] != 0) {
        // One byte more than the longest is enough to know that it is too long.
        if (chunk_.size() <= kMaxPayload + 1) chunk_.push_back(data[i]);
        continue;
      }
      Seen seen;
      if (decode(seen)) sink(seen);
      chunk_.clear();
    }
  }
  void forget() { chunk_.clear(); }

 private:
  bool decode(Seen& out) {
    if (chunk_.empty() || chunk_.size() > kMaxPayload + 1) return false;
    std::vector<uint8_t>& payload = payload_;
    payload.clear();
    for (size_t at = 0; at < chunk_.size();) {
      const size_t next = at + chunk_[at];
      if (next > chunk_.size()) return false;
      payload.insert(payload.end(), chunk_.begin() + static_cast<std::ptrdiff_t>(at) + 1,
                     chunk_.begin() + static_cast<std::ptrdiff_t>(next));
      if (next < chunk_.size()) payload.push_back(0);
      at = next;
    }
    if (payload.size() < 7) return false;
    uint32_t remainder = 0xffffffff;
    for (size_t i = 0; i + 4 < payload.size(); ++i)
      remainder = remainder >> 8 ^ kRemainders[(remainder ^ payload[i]) & 0xff];
    uint32_t crc = 0;
    for (size_t i = 0; i < 4; ++i)
      crc |= static_cast<uint32_t>(payload[payload.size() - 4 + i]) << 8 * i;
    if (crc != (remainder ^ 0xffffffff)) return false;
    out.id = payload[0];
    out.body.assign(payload.begin() + 3, payload.end() - 4);
    return body_size(out.id) == static_cast<int>(out.body.size());
  }

  /// CRC of each byte, from CRC-32's polynomial: the firmware's own table is under test.
  static constexpr auto kRemainders = [] {
    std::array<uint32_t, 256> remainders{};
    for (uint32_t byte = 0; byte < remainders.size(); ++byte) {
      uint32_t remainder = byte;
      for (int bit = 0; bit < 8; ++bit)
        remainder = remainder >> 1 ^ ((remainder & 1) != 0 ? 0xedb88320U : 0U);
      remainders[byte] = remainder;
    }
    return remainders;
  }();

  std::vector<uint8_t> chunk_;
  std::vector<uint8_t> payload_;
};

}  // namespace wheelwire::explore
