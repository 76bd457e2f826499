// The flash: one block in memory, or in a file that outlives the program; and the memory that a
// reset of the processor leaves alone.
#pragma once

#include <optional>
#include <string>

#include "hal.hpp"
#include "uart.hpp"

namespace wheelwire::sim {

class Store final : public ParameterStore {
 public:
  bool failing = false;     ///< Saving and erasing fail, and change nothing.
  uint32_t unreadable = 0;  ///< Why it cannot be read, as flags of `fault`; erasing clears it.

  /// From now on the block is kept in this file.
  void use_file(const std::string& path) { path_ = path; }

  size_t load(uint8_t* out, size_t capacity) override;
  bool save(const uint8_t* data, size_t size) override;
  bool erase() override;
  uint32_t faults() override { return unreadable; }

 private:
  std::optional<std::string> path_;
  Bytes block_;  ///< Used when there is no file.
};

/// As the chip's RTC memory.
class RetainedMemory final : public LatchMemory {
 public:
  size_t load(uint8_t* out, size_t capacity) override;
  void save(const uint8_t* data, size_t size) override { bytes_.assign(data, data + size); }
  /// The power was off, or the reset pin was pulled.
  void lose() { bytes_.clear(); }

 private:
  Bytes bytes_;
};

}  // namespace wheelwire::sim
