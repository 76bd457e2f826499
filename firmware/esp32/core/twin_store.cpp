#include "twin_store.hpp"

#include <string.h>

#include "crc32.hpp"
#include "protocol.hpp"
#include "wire.hpp"

namespace wheelwire {
namespace {

constexpr size_t kTail = 8;  // The number and the checksum.
constexpr int kAttempts = 2;

}  // namespace

size_t TwinStore::load(uint8_t* out, size_t capacity) {
  uint32_t number;
  const int slot = find(number);
  if (slot < 0) return 0;
  const size_t size = read(slot).size;
  memcpy(out, buffer_, size < capacity ? size : capacity);
  return size;
}

bool TwinStore::save(const uint8_t* data, size_t size) {
  if (size == 0 || size > kCapacity) return false;
  uint32_t number = 0;
  const int to = find(number) == 0 ? 1 : 0;
  ++number;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    memcpy(buffer_, data, size);
    uint8_t* at = buffer_ + size;
    wire::put(at, number);
    wire::put(at, crc32(buffer_, size + sizeof number));
    if (!slots_[to]->save(buffer_, size + kTail)) return false;
    const Slot written = read(to);
    if (written.size == size && written.number == number && memcmp(buffer_, data, size) == 0) {
      faults_ = 0;
      return true;
    }
  }
  return false;
}

bool TwinStore::erase() {
  // The valid one last: until it is gone, a cut of the power leaves it and not the one before.
  uint32_t number;
  const int last = find(number) == 0 ? 0 : 1;
  const bool both_erased = slots_[1 - last]->erase() && slots_[last]->erase();
  if (both_erased) faults_ = 0;
  return both_erased;
}

TwinStore::Slot TwinStore::read(int slot) {
  Slot found;
  const size_t size = slots_[slot]->load(buffer_, sizeof buffer_);
  if (size == 0) return found;
  if (size <= kTail || size > sizeof buffer_ || crc32(buffer_, size) != kCrcResidue) {
    found.is_damaged = true;
    return found;
  }
  found.size = size - kTail;
  const uint8_t* at = buffer_ + found.size;
  wire::get(at, found.number);
  return found;
}

int TwinStore::find(uint32_t& number) {
  const Slot slots[2] = {read(0), read(1)};
  // The difference, as the numbers may wrap.
  const bool is_second_newer =
      slots[0].size == 0 || static_cast<int32_t>(slots[1].number - slots[0].number) > 0;
  const int newest = slots[1].size != 0 && is_second_newer ? 1 : 0;
  if (slots[newest].size != 0) {
    faults_ = 0;
    number = slots[newest].number;
    return newest;
  }
  faults_ = slots_[0]->faults() | slots_[1]->faults();
  if (slots[0].is_damaged || slots[1].is_damaged) faults_ |= fault::kStoreUnreadable;
  return -1;
}

}  // namespace wheelwire
