// What a UART receives if its baud rate differs from the sender's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace wheelwire::sim {

using Bytes = std::vector<uint8_t>;

constexpr size_t kDataBits = 8;
constexpr size_t kFrameBits = 10;  // Start, data, stop.
constexpr double kOversampling = 16.0;

/// The line's level at a time in the sender's bits; idle is high.
inline bool line_level(const Bytes& sent, double bit_time) {
  const auto bit = static_cast<size_t>(bit_time);
  if (bit >= sent.size() * kFrameBits) return true;
  // Start low, least significant bit first, stop high.
  const size_t index = bit % kFrameBits;
  if (index == 0) return false;
  return index > kDataBits || (sent[bit / kFrameBits] >> (index - 1) & 1) != 0;
}

/// `sent` goes out back to back at `from_baud` (8N1) and is sampled mid-bit at `to_baud`. Bytes
/// with a framing error are delivered, as the chip's driver does. At equal rates nothing changes,
/// nor without a rate (0) at one end.
inline Bytes resample(const Bytes& sent, uint32_t from_baud, uint32_t to_baud) {
  if (from_baud == to_baud || from_baud == 0 || to_baud == 0) return sent;
  const double receiver_bit = static_cast<double>(from_baud) / to_baud;  // In the sender's bits.
  const double search_step = receiver_bit / kOversampling;
  const double end = static_cast<double>(sent.size() * kFrameBits);
  Bytes received;
  double now = 0.0;
  while (now < end) {
    if (line_level(sent, now)) {
      now += search_step;
      continue;
    }
    unsigned byte = 0;
    for (size_t bit = 0; bit < kDataBits; ++bit) {
      const double sample_time = now + (static_cast<double>(bit) + 1.5) * receiver_bit;
      byte |= static_cast<unsigned>(line_level(sent, sample_time)) << bit;
    }
    received.push_back(static_cast<uint8_t>(byte));
    now += (static_cast<double>(kDataBits) + 1.5) * receiver_bit;
    // After a framing error the receiver waits for the line to go idle.
    while (now < end && !line_level(sent, now)) now += search_step;
  }
  return received;
}

}  // namespace wheelwire::sim
