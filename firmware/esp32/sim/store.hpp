// The flash: one block in two slots, as on the chip, in memory or in a file that outlives the
// program; and the memory that a reset of the processor leaves alone.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "hal.hpp"
#include "twin_store.hpp"
#include "uart.hpp"

namespace wheelwire::sim {

class Store;

/// What becomes of a write. Where the power goes in the middle of it, what was there is lost.
enum class WriteFate { kDone, kUntouched, kLost };

/// Asked before each write to a slot: saving makes one, erasing both slots two.
class StoreWatch {
 public:
  virtual WriteFate fate_of_write(const Store& store) = 0;

 protected:
  ~StoreWatch() = default;
};

/// What time does to flash: a slot cannot be read; or, if the other one holds something, is empty.
enum class Damage { kNewest, kAll, kNewestEmpty };

/// What all stores lie in. Where it cannot be opened, none can be read or written, and erasing any
/// of them formats it, as on the chip (main/nvs_store.cpp).
struct Partition {
  uint32_t faults = 0;  ///< Why it cannot be opened, as flags of `fault`.
  std::vector<Store*> stores;
};

class Store final : public ParameterStore {
 public:
  bool failing = false;  ///< Saving and erasing fail, and change nothing.
  StoreWatch* watch = nullptr;
  uint32_t unreadable = 0;  ///< Why it cannot be read, as flags of `fault`; erasing clears it.

  /// From now on it is one of those in this partition.
  void lie_in(Partition& partition) {
    partition_ = &partition;
    partition.stores.push_back(this);
  }
  /// From now on this file holds both slots. It is read here, and written whenever one changes.
  void use_file(const std::string& path);

  Store() = default;
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  size_t load(uint8_t* out, size_t capacity) override;
  bool save(const uint8_t* data, size_t size) override;
  bool erase() override;
  /// Of the slots that hold something.
  void damage(Damage what);
  uint32_t faults() override { return unreadable | partition_faults() | twin_.faults(); }

 private:
  class Slot final : public ParameterStore {
   public:
    explicit Slot(Store& store) : store_(store) {}
    size_t load(uint8_t* out, size_t capacity) override;
    bool save(const uint8_t* data, size_t size) override;
    bool erase() override;
    const Bytes& bytes() const { return bytes_; }
    void put(Bytes bytes) { bytes_.swap(bytes); }

   private:
    bool write(Bytes bytes);

    Store& store_;
    Bytes bytes_;
  };

  uint32_t partition_faults() const { return partition_ != nullptr ? partition_->faults : 0; }
  bool format();
  /// Where there is a file. It holds what was in it before, or all of both slots.
  bool write_file() const;
  WriteFate fate() {
    if (failing) return WriteFate::kUntouched;
    return watch != nullptr ? watch->fate_of_write(*this) : WriteFate::kDone;
  }

  Partition* partition_ = nullptr;
  std::optional<std::string> path_;
  Slot first_{*this};
  Slot second_{*this};
  Slot* newest_ = nullptr;  ///< The last one that was written.
  TwinStore twin_{first_, second_};
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
