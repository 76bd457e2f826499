// A block in the chip's non-volatile storage (NVS): a slot of a TwinStore.
#pragma once

#include "hal.hpp"
#include "nvs.h"

namespace wheelwire {

/// Formats only when the host asks for it: what cannot be read may still be needed. A cut of the
/// power may lose the block: a TwinStore has two.
class NvsStore final : public BlockStore {
 public:
  /// `key`: of the block, at most 15 letters.
  explicit NvsStore(const char* key) : key_(key) {}

  /// Never fails: without storage there is nothing to load, saving is refused, and faults() says
  /// why.
  void start();

  size_t load(uint8_t* out, size_t capacity) override;
  bool save(const uint8_t* data, size_t size) override;
  bool format() override;
  uint32_t faults() override { return faults_; }

 private:
  bool open();

  const char* key_;
  nvs_handle_t handle_ = 0;
  bool open_ = false;
  uint32_t faults_ = 0;
};

}  // namespace wheelwire
