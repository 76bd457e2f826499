#include "peripherals.hpp"

#include "crc32.hpp"

namespace wheelwire {

uint32_t write_list(const PeripheralList& list, uint8_t* out) {
  uint8_t* at = out;
  wire::put(at, kPeripheralFormat);
  wire::put(at, list.count);
  wire::put(at, uint16_t{0});
  wire::put(at, list.board);
  for (size_t i = 0; i < kMostPeripherals; ++i) {
    (i < list.count ? list.entries[i] : Peripheral{}).encode(at);
    at += Peripheral::kSize;
  }
  const uint32_t crc = crc32(out, static_cast<size_t>(at - out));
  wire::put(at, crc);
  return crc;
}

PeripheralFault read_list(const uint8_t* data, size_t size, PeripheralList& out) {
  if (size != PeripheralList::kSize || crc32(data, size) != kCrcResidue)
    return PeripheralFault::kDamaged;
  if (data[0] != kPeripheralFormat) return PeripheralFault::kFormat;
  if (data[1] > kMostPeripherals) return PeripheralFault::kTooMany;
  out.count = data[1];
  const uint8_t* at = data + 4;
  wire::get(at, out.board);
  for (Peripheral& entry : out.entries) {
    entry = Peripheral::decode(at);
    at += Peripheral::kSize;
  }
  return PeripheralFault::kNone;
}

}  // namespace wheelwire
