// What the core drives and listens to, as plain values that the caller passes in and out.
#pragma once

#include <string.h>

#include "byte_queue.hpp"
#include "flash_region.hpp"
#include "hal.hpp"
#include "latches.hpp"
#include "parameters.hpp"
#include "twin_store.hpp"
#include "wheelwire_core.h"

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

  /// A change too large for one step, because the step came very late, is spread over the next
  /// ones: ticks may be late, but none are lost.
  void update(int32_t ticks) {
    const auto ahead =
        static_cast<int32_t>(static_cast<uint32_t>(ticks) - static_cast<uint32_t>(ticks_));
    const int32_t change = ahead > kMaxChange    ? kMaxChange
                           : ahead < -kMaxChange ? -kMaxChange
                                                 : ahead;
    ticks_ = static_cast<int32_t>(static_cast<uint32_t>(ticks_) + static_cast<uint32_t>(change));
    value_ = static_cast<int16_t>((value_ + change) % kCounterLimit);
  }

  int16_t value() const { return value_; }

 private:
  static constexpr int32_t kMaxChange = kCounterLimit / 2;

  int32_t ticks_ = 0;
  int16_t value_ = 0;
};

class Encoders final : public EncoderPort {
 public:
  uint64_t now_us = 0;
  TickCounter left;
  TickCounter right;
  uint32_t left_illegal = 0;
  uint32_t right_illegal = 0;
  EncoderCounts latch() override {
    return {.t_us = now_us,
            .left = left.value(),
            .right = right.value(),
            .left_illegal = left_illegal,
            .right_illegal = right_illegal};
  }
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
      const size_t size = at[0] | static_cast<size_t>(at[1]) << 8;
      at += 2;
      const auto left = static_cast<size_t>(end - at);
      put(at, size < left ? size : left);
      return at + (size < left ? size : left);
    }
    uint8_t* write(uint8_t* at) const {
      *at++ = static_cast<uint8_t>(size_);
      *at++ = static_cast<uint8_t>(size_ >> 8);
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

/// Stores nothing: the caller's record is enough.
class NoStore final : public BlockStore {
 public:
  size_t load(uint8_t*, size_t) override { return 0; }
  bool save(const uint8_t*, size_t) override { return true; }
};

class Contact final : public EstopInput {
 public:
  bool open = false;
  bool is_open() override { return open; }
};

class Battery final : public BatterySense {
 public:
  uint16_t mv = 0;
  uint16_t millivolts() override { return mv; }
};

}  // namespace wheelwire::capi
