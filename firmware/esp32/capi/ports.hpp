// What the core drives and listens to, as plain values that the caller passes in and out.
#pragma once

#include <string.h>

#include "byte_queue.hpp"
#include "fixed.hpp"
#include "flash_region.hpp"
#include "given_ports.hpp"
#include "latches.hpp"
#include "parameters.hpp"
#include "twin_store.hpp"
#include "wheelwire_core.h"
#include "wire.hpp"

namespace wheelwire::capi {

class Pins final : public StagePort {
 public:
  void set(const StageOutputs& outputs) override {
    static_assert(sizeof pins_ == sizeof outputs.duty_q15);
    memcpy(&pins_, outputs.duty_q15, sizeof pins_);
  }

  const wheelwire_stage& inputs() const { return pins_; }

 private:
  wheelwire_stage pins_{};
};

/// Turns ticks that the caller counted into what a chip's counter would read.
class TickCounter {
 public:
  void start(int32_t ticks) { ticks_ = ticks; }

  /// What the counter reads now. A change too large for one step, because the step came very late,
  /// is spread over the next ones: ticks may be late, but none are lost.
  int16_t update(int32_t ticks) {
    const int32_t change = clamp(wrapped_difference(ticks, ticks_), -kMaxChange, kMaxChange);
    ticks_ = static_cast<int32_t>(static_cast<uint32_t>(ticks_) + static_cast<uint32_t>(change));
    return value_ = static_cast<int16_t>((value_ + change) % kCounterLimit);
  }

 private:
  static constexpr int32_t kMaxChange = kCounterLimit / 2;

  int32_t ticks_ = 0;
  int16_t value_ = 0;
};

class Line final : public ByteStream {
 public:
  ByteQueue<4096> received;
  ByteQueue<4096> to_send;

  size_t read(uint8_t* out, size_t capacity) override { return received.take(out, capacity); }
  bool write(const uint8_t* data, size_t size) override { return to_send.put(data, size); }
  uint32_t bytes_per_second() const override { return 0; }
};

/// The caller's block: the saved parameters in two copies, each behind its size.
class Store {
 public:
  Store(const uint8_t* block, size_t size, wheelwire_save save, void* context)
      : save_(save), context_(context) {
    if (size >= kHead && memcmp(block, kMagic, kHead) == 0) {
      const uint8_t* at = block + kHead;
      for (Copy& copy : copies_) at = copy.take(at, block + size);
    } else if (size > 0) {
      copies_[0].put(block, size);  // As an earlier release wrote it, or damaged.
    }
  }
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  TwinStore& parameters() { return parameters_; }

 private:
  static constexpr char kMagic[] = "WWF2";
  static constexpr size_t kHead = sizeof kMagic - 1;
  static constexpr size_t kRoom = kMaxParameterBlock + TwinStore::kTail;

  class Copy final : public BlockStore {
   public:
    explicit Copy(Store& store) : store_(store) {}

    size_t load(uint8_t* out, size_t capacity) override {
      memcpy(out, bytes_, size_ < capacity ? size_ : capacity);
      return size_;
    }
    bool save(const uint8_t* data, size_t size) override {
      if (size > sizeof bytes_) return false;
      const Copy before = *this;
      put(data, size);
      if (store_.forward()) return true;
      put(before.bytes_, before.size_);
      return false;
    }

    /// Longer bytes are damaged, and stay so when they are cut off.
    void put(const uint8_t* data, size_t size) {
      size_ = size < sizeof bytes_ ? size : sizeof bytes_;
      if (size_ > 0) memcpy(bytes_, data, size_);
    }
    /// Reads what `write` wrote; returns what follows.
    const uint8_t* take(const uint8_t* at, const uint8_t* end) {
      if (end - at < 2) return end;
      const size_t size = wire::take<uint16_t>(at);
      const auto left = static_cast<size_t>(end - at);
      put(at, size < left ? size : left);
      return at + (size < left ? size : left);
    }
    uint8_t* write(uint8_t* at) const {
      wire::put(at, static_cast<uint16_t>(size_));
      memcpy(at, bytes_, size_);
      return at + size_;
    }

   private:
    Store& store_;
    size_t size_ = 0;
    uint8_t bytes_[kRoom];
  };

  bool forward() const {
    uint8_t block[kHead + 2 * (2 + kRoom)];
    memcpy(block, kMagic, kHead);
    uint8_t* at = block + kHead;
    for (const Copy& copy : copies_) at = copy.write(at);
    return save_(context_, block, static_cast<size_t>(at - block)) != 0;
  }

  wheelwire_save save_;
  void* context_;
  Copy copies_[2]{Copy{*this}, Copy{*this}};
  TwinStore parameters_{copies_[0], copies_[1]};
};

/// What is latched, kept by the caller.
class LatchRecord final : public LatchMemory {
 public:
  void use(const uint8_t* record, size_t size, wheelwire_save forward, void* context) {
    save_ = forward;
    context_ = context;
    // A longer one is damaged, and stays so when it is cut off.
    size_ = size < sizeof record_ ? size : sizeof record_;
    if (size_ > 0) memcpy(record_, record, size_);
  }

  size_t load(uint8_t* out, size_t capacity) override {
    memcpy(out, record_, size_ < capacity ? size_ : capacity);
    return size_;
  }
  void save(const uint8_t* data, size_t size) override {
    if (save_ != nullptr) save_(context_, data, size);
  }

 private:
  wheelwire_save save_ = nullptr;
  void* context_ = nullptr;
  uint8_t record_[Latches::kSize + 1];
  size_t size_ = 0;
};

/// The recorder's content, as flash would hold it; each change is passed on to the caller.
class RecorderFlash final : public FlashRegion {
 public:
  RecorderFlash(const uint8_t* content, wheelwire_write forward, void* context)
      : forward_(forward), context_(context) {
    if (content != nullptr) {
      memcpy(bytes_, content, sizeof bytes_);
    } else {
      memset(bytes_, 0xff, sizeof bytes_);
    }
  }

  bool read(uint32_t offset, uint8_t* out, size_t size) override {
    memcpy(out, bytes_ + offset, size);
    return true;
  }
  bool write(uint32_t offset, const uint8_t* data, size_t size) override {
    for (size_t i = 0; i < size; ++i) bytes_[offset + i] &= data[i];
    return forward_(context_, offset, bytes_ + offset, size) != 0;
  }
  bool erase(uint32_t offset) override {
    memset(bytes_ + offset, 0xff, kFlashSector);
    return forward_(context_, offset, bytes_ + offset, kFlashSector) != 0;
  }

 private:
  wheelwire_write forward_;
  void* context_;
  uint8_t bytes_[WHEELWIRE_RECORDER_SIZE];
};

}  // namespace wheelwire::capi
