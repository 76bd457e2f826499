// The flash of the recorder's partition, in memory or in a storage that outlives the program: bits
// are cleared by a write, and set by an erasure.
#pragma once

#include <cstdint>
#include <memory>

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
  void keep_in(std::unique_ptr<Storage> storage);

  bool read(uint32_t offset, uint8_t* out, size_t size) override;
  bool write(uint32_t offset, const uint8_t* data, size_t size) override;
  bool erase(uint32_t offset) override;

 private:
  bool put(size_t offset, size_t size);

  Bytes bytes_;
  std::unique_ptr<Storage> storage_;
  bool is_stored_ = false;  ///< All of it.
};

}  // namespace wheelwire::sim
