// The flash of the recorder's partition, in memory or in a file that outlives the program: bits are
// cleared by a write, and set by an erasure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "flash_region.hpp"

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
  Flash(const Flash&) = delete;
  Flash& operator=(const Flash&) = delete;
  ~Flash();

  FlashWatch* watch = nullptr;

  /// From now on this file holds it; it is made by the first write.
  void use_file(const std::string& path);

  bool read(uint32_t offset, uint8_t* out, size_t size) override;
  bool write(uint32_t offset, const uint8_t* data, size_t size) override;
  bool erase(uint32_t offset) override;

 private:
  bool put(size_t offset, size_t size);

  std::vector<uint8_t> bytes_;
  std::string path_;
  int file_ = -1;
};

}  // namespace wheelwire::sim
