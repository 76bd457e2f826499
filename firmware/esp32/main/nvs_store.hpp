// The parameters' block in the chip's non-volatile storage (NVS). Its version and CRC are the
// core's; NVS replaces it as a whole or not at all.
#pragma once

#include "hal.hpp"
#include "nvs.h"

namespace wheelwire {

class NvsStore final : public ParameterStore {
 public:
  /// Never fails: without storage there is nothing to load, and saving is refused.
  void start();

  size_t load(uint8_t* out, size_t capacity) override;
  bool save(const uint8_t* data, size_t size) override;
  bool erase() override;

 private:
  nvs_handle_t handle_ = 0;
  bool open_ = false;
  bool lost_ = false;  ///< The partition was unreadable and is formatted anew.
};

}  // namespace wheelwire
