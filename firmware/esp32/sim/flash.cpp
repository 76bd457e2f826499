#include "flash.hpp"

#include <algorithm>
#include <utility>

namespace wheelwire::sim {

void Flash::keep_in(std::unique_ptr<Storage> storage) {
  const Bytes stored = storage->read();
  // If there is too little, the rest is as erased.
  std::copy_n(stored.begin(), std::min(stored.size(), bytes_.size()), bytes_.begin());
  storage_ = std::move(storage);
}

bool Flash::read(uint32_t offset, uint8_t* out, size_t size) {
  std::copy_n(bytes_.begin() + offset, size, out);
  return true;
}

bool Flash::write(uint32_t offset, const uint8_t* data, size_t size) {
  if (watch != nullptr) watch->on_flash();
  for (size_t i = 0; i < size; ++i) bytes_[offset + i] &= data[i];
  return put(offset, size);
}

bool Flash::erase(uint32_t offset) {
  if (watch != nullptr) watch->on_flash();
  std::fill_n(bytes_.begin() + offset, kFlashSector, uint8_t{0xff});
  return put(offset, kFlashSector);
}

bool Flash::put(size_t offset, size_t size) {
  if (!storage_) return true;
  if (is_stored_) return storage_->write(offset, bytes_.data() + offset, size);
  is_stored_ = storage_->write(0, bytes_.data(), bytes_.size());
  return is_stored_;
}

}  // namespace wheelwire::sim
