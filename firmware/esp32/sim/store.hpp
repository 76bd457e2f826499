// The flash: one block in two slots, as on the chip, in memory or in a storage that outlives the
// program; and the memory that a reset of the processor leaves alone.
#pragma once

#include <algorithm>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "hal.hpp"
#include "storage.hpp"
#include "twin_store.hpp"
#include "uart.hpp"

namespace wheelwire::sim {

class Store;

/// The fate of a write. If the power fails in the middle of it, the old content is lost.
enum class WriteFate { kDone, kUntouched, kLost };

/// Asked before each write to a slot, and before all is formatted.
class StoreWatch {
 public:
  static constexpr int kFormat = -1;

  /// `slot`: 0, 1 or kFormat.
  virtual WriteFate fate_of_write(const Store& store, int slot) = 0;

 protected:
  ~StoreWatch() = default;
};

/// The power fails in the middle of a write, and of those after it nothing is left.
struct PowerCut final : StoreWatch {
  uint32_t writes_left = 0;  ///< The one in which it fails is the last of so many; 0: none.
  bool has_failed = false;

  WriteFate fate_of_write(const Store&, int) override {
    if (has_failed) return WriteFate::kUntouched;
    if (writes_left == 0 || --writes_left > 0) return WriteFate::kDone;
    has_failed = true;
    return WriteFate::kLost;
  }
};

/// Damage by ageing flash. NVS erases what it cannot read, so a damaged slot is empty.
enum class Damage { kFirst, kSecond, kBoth };

/// What all stores lie in. Where it cannot be opened, none can be read or written before one of
/// them formats it, as on the chip (main/nvs_store.hpp).
struct Partition {
  uint32_t faults = 0;  ///< Why it cannot be opened, as flags of `fault`.
  std::vector<Store*> stores;
};

class Store final : public BlockStore {
 public:
  bool failing = false;  ///< Saving and formatting fail, and change nothing.
  StoreWatch* watch = nullptr;
  uint32_t unreadable = 0;  ///< Why it cannot be read, as flags of `fault`; a save clears it.

  /// From now on it is one of this partition's stores.
  void lie_in(Partition& partition) {
    partition_ = &partition;
    partition.stores.push_back(this);
  }
  /// From now on this one records whether these have a block.
  void record(Store& parameters, Store& latches) { twin_.record(parameters.twin_, latches.twin_); }
  /// From now on this holds both slots. It is read here, and written whenever one changes.
  void keep_in(std::unique_ptr<Storage> storage) {
    const Bytes file = storage->read();
    const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
    const bool has_slots = text.starts_with(kHeader);
    if (has_slots) {
      first_.bytes = slot_of(file, 0);
      second_.bytes = slot_of(file, 1);
    } else if (!file.empty()) {
      first_.bytes = file;  // Of an earlier release, or damaged.
    }
    storage_ = std::move(storage);
  }

  Store() = default;
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  size_t load(uint8_t* out, size_t capacity) override {
    return (unreadable | partition_faults()) != 0 ? 0 : twin_.load(out, capacity);
  }

  bool save(const uint8_t* data, size_t size) override {
    if (partition_faults() != 0 || !twin_.save(data, size)) return false;
    unreadable = 0;
    return true;
  }

  bool format() override {
    if (partition_faults() == 0) return true;
    if (fate(StoreWatch::kFormat) != WriteFate::kDone) return false;
    partition_->faults = 0;
    bool is_clear = true;
    for (Store* const store : partition_->stores) is_clear = store->clear() && is_clear;
    return is_clear;
  }
  /// Of the slots that hold something.
  void damage(Damage what) {
    if (what != Damage::kSecond) first_.bytes = {};
    if (what != Damage::kFirst) second_.bytes = {};
    put();
  }
  /// If nothing can be read, the slots' content does not matter.
  uint32_t faults() override {
    const uint32_t closed = unreadable | partition_faults();
    return closed != 0 ? closed : twin_.faults();
  }
  bool has_lost_copy() override { return twin_.has_lost_copy(); }
  bool is_incomplete() override { return twin_.is_incomplete(); }
  bool repair() override { return partition_faults() == 0 && twin_.repair(); }

 private:
  static constexpr std::string_view kHeader = "WWS3";
  /// A slot in the storage is the size of its content, and room for it.
  static constexpr size_t kSlotRoom = 1024;

  static void append_slot(Bytes& file, const Bytes& slot) {
    const size_t end = file.size() + kSlotRoom;
    file.push_back(static_cast<uint8_t>(slot.size()));
    file.push_back(static_cast<uint8_t>(slot.size() >> 8));
    file.insert(file.end(), slot.begin(), slot.end());
    file.resize(end);
  }

  /// Where it is damaged, bytes that no slot holds.
  static Bytes slot_of(const Bytes& file, size_t number) {
    const size_t at = kHeader.size() + number * kSlotRoom;
    if (at + kSlotRoom > file.size()) return Bytes(1);
    const size_t size = file[at] | static_cast<size_t>(file[at + 1]) << 8;
    const auto first = file.begin() + static_cast<std::ptrdiff_t>(at + 2);
    return Bytes(first, first + static_cast<std::ptrdiff_t>(std::min(size, kSlotRoom - 2)));
  }

  class Slot final : public BlockStore {
   public:
    explicit Slot(Store& store) : store_(store) {}
    size_t load(uint8_t* out, size_t capacity) override {
      std::copy_n(bytes.begin(), std::min(capacity, bytes.size()), out);
      return bytes.size();
    }
    bool save(const uint8_t* data, size_t size) override {
      const WriteFate fate = store_.fate(this == &store_.first_ ? 0 : 1);
      if (fate == WriteFate::kUntouched) return false;
      Bytes other = fate == WriteFate::kLost ? Bytes() : Bytes(data, data + size);
      bytes.swap(other);
      if (store_.put()) return fate == WriteFate::kDone;
      bytes.swap(other);
      return false;
    }
    Bytes bytes;

   private:
    Store& store_;
  };

  uint32_t partition_faults() const { return partition_ != nullptr ? partition_->faults : 0; }
  /// Deletes the block.
  bool clear() {
    unreadable = 0;
    first_.bytes = {};
    second_.bytes = {};
    return put();
  }

  /// Where there is a storage. It holds what was in it before, or all of both slots.
  bool put() const {
    if (!storage_) return true;
    if (first_.bytes.empty() && second_.bytes.empty()) return storage_->replace({});
    Bytes file(kHeader.begin(), kHeader.end());
    append_slot(file, first_.bytes);
    append_slot(file, second_.bytes);
    return storage_->replace(file);
  }

  WriteFate fate(int slot) {
    if (failing) return WriteFate::kUntouched;
    return watch != nullptr ? watch->fate_of_write(*this, slot) : WriteFate::kDone;
  }

  Partition* partition_ = nullptr;
  std::unique_ptr<Storage> storage_;
  Slot first_{*this};
  Slot second_{*this};
  TwinStore twin_{first_, second_};
};

/// As the chip's RTC memory.
class RetainedMemory final : public LatchMemory {
 public:
  size_t load(uint8_t* out, size_t capacity) override {
    std::copy_n(bytes_.begin(), std::min(capacity, bytes_.size()), out);
    return bytes_.size();
  }
  void save(const uint8_t* data, size_t size) override { bytes_.assign(data, data + size); }
  /// The power was off, or the reset pin was pulled.
  void lose() { bytes_.clear(); }

 private:
  Bytes bytes_;
};

}  // namespace wheelwire::sim
