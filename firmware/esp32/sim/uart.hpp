// What a UART receives if its baud rate differs from the sender's.
#pragma once

#include <cstdint>
#include <vector>

namespace wheelwire::sim {

using Bytes = std::vector<uint8_t>;

/// `sent` goes out back to back at `from_baud` (8N1) and is sampled mid-bit at `to_baud`. Bytes
/// with a framing error are delivered, as the chip's driver does. At equal rates nothing changes.
Bytes resample(const Bytes& sent, uint32_t from_baud, uint32_t to_baud);

}  // namespace wheelwire::sim
