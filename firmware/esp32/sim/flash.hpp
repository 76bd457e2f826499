// The flash of the recorder's partition, in memory or in a storage that outlives the program: bits
// are cleared by a write, and set by an erasure.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <utility>

#include "flash_region.hpp"
#include "storage.hpp"

namespace wheelwire::sim {

/// Called before each operation that changes the flash.
class FlashWatch {
 public:
  virtual void on_flash() = 0;

 protected:
  ~FlashWatch() = default;
};

class Flash final : public FlashRegion {
 public:
  explicit Flash(size_t size) : bytes_(size, 0xff) {}
  FlashWatch* watch = nullptr;

  /// Takes the content of this storage; from now on, writes go to it.
  void keep_in(std::unique_ptr<Storage> storage) {
    const Bytes stored = storage->read();
    // If there is too little, the rest is as erased.
    std::copy_n(stored.begin(), std::min(stored.size(), bytes_.size()), bytes_.begin());
    storage_ = std::move(storage);
  }

  bool read(uint32_t offset, uint8_t* out, size_t size) override {
    std::copy_n(bytes_.begin() + offset, size, out);
    return true;
  }

  bool write(uint32_t offset, const uint8_t* data, size_t size) override {
    if (watch != nullptr) watch->on_flash();
    for (size_t i = 0; i < size; ++i) bytes_[offset + i] &= data[i];
    return put(offset, size);
  }

  bool erase(uint32_t offset) override {
    if (watch != nullptr) watch->on_flash();
    std::fill_n(bytes_.begin() + offset, kFlashSector, uint8_t{0xff});
    return put(offset, kFlashSector);
  }

 private:
  bool put(size_t offset, size_t size) {
    if (!storage_) return true;
    if (is_stored_) return storage_->write(offset, bytes_.data() + offset, size);
    is_stored_ = storage_->write(0, bytes_.data(), bytes_.size());
    return is_stored_;
  }

  Bytes bytes_;
  std::unique_ptr<Storage> storage_;
  bool is_stored_ = false;  ///< All of it.
};

}  // namespace wheelwire::sim
