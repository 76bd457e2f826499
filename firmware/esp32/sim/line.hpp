// The serial line between host and chip: bounded buffers on the chip, a wire of finite speed.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>

#include "hal.hpp"
#include "uart.hpp"

namespace wheelwire::sim {

/// Sees what the firmware reads and writes, at that moment.
class LineTap {
 public:
  /// `size` 0: it has handled all that there was.
  virtual void on_read(const uint8_t* data, size_t size) = 0;
  virtual void on_write(const uint8_t* data, size_t size) = 0;

 protected:
  ~LineTap() = default;
};

class Line final : public ByteStream {
 public:
  /// As on the chip (main/uart_line.cpp). Bytes that arrive while it is full are lost.
  static constexpr size_t kReceiveCapacity = 2048;
  /// More than the chip's 1024 (main/uart_line.cpp), behind which is the UART's own FIFO.
  static constexpr size_t kSendCapacity = 2048;
  /// Bytes that wait for a host that does not read, or for a slow wire to the device; more are
  /// lost.
  static constexpr size_t kHostCapacity = 1 << 20;

  size_t read(uint8_t* out, size_t capacity) override {
    if (tap_ == nullptr) return take(receive_, out, capacity);
    const auto zero = std::find(receive_.begin(), receive_.end(), uint8_t{0});
    const auto chunk = static_cast<size_t>(zero - receive_.begin()) + 1;
    const size_t size = take(receive_, out, std::min(chunk, capacity));
    tap_->on_read(out, size);
    return size;
  }

  bool write(const uint8_t* data, size_t size) override {
    if (size > kSendCapacity - send_.size()) return false;
    send_.insert(send_.end(), data, data + size);
    if (tap_ != nullptr) tap_->on_write(data, size);
    return true;
  }

  uint32_t bytes_per_second() const override { return baud_ / 10; }
  uint32_t baud() const { return baud_; }
  /// 0: no limit, as on native USB.
  void set_baud(uint32_t baud) { baud_ = baud; }
  /// From now on the firmware reads no further than the next zero in one call, so that the tap sees
  /// each frame just before the firmware handles it.
  void set_tap(LineTap* tap) { tap_ = tap; }

  /// Bytes from the host onto the wire.
  void host_write(const uint8_t* data, size_t size) {
    const size_t room = kHostCapacity - std::min(kHostCapacity, wire_to_device_.size());
    const size_t taken = std::min(size, room);
    wire_to_device_.insert(wire_to_device_.end(), data, data + taken);
    lost_to_device_ += size - taken;
  }

  size_t host_read(uint8_t* out, size_t capacity) { return take(to_host_, out, capacity); }
  size_t host_waiting() const { return to_host_.size(); }

  /// Carries bytes over the wire for `seconds`. A device that is not `listening` loses what
  /// arrives.
  void carry(double seconds, bool listening) {
    size_t arriving = wire_share(seconds, wire_to_device_.size(), credit_to_device_);
    for (; arriving > 0; --arriving) {
      if (listening && receive_.size() < kReceiveCapacity) {
        receive_.push_back(wire_to_device_.front());
      } else {
        ++lost_to_device_;
      }
      wire_to_device_.pop_front();
    }
    size_t leaving = wire_share(seconds, send_.size(), credit_to_host_);
    for (; leaving > 0; --leaving) {
      deliver_to_host(send_.front());
      send_.pop_front();
    }
  }

  /// Until the last byte on either wire has arrived, whichever is first [s]; 0 when both are idle.
  double until_idle() const {
    const double to_device = seconds_for(wire_to_device_.size(), credit_to_device_);
    const double to_host = seconds_for(send_.size(), credit_to_host_);
    return to_device > 0.0 && to_host > 0.0 ? std::min(to_device, to_host)
                                            : std::max(to_device, to_host);
  }

  /// Empties the chip's buffers, as a reset does.
  void reset() {
    receive_.clear();
    send_.clear();
  }

  /// Bytes that the chip sends without the firmware, at its boot ROM's baud rate.
  void emit_from_rom(const Bytes& text) {
    for (const uint8_t byte : resample(text, kRomBaud, baud_)) deliver_to_host(byte);
  }

  /// Whether the firmware can send this many bytes now.
  bool has_room(size_t size) const { return size <= kSendCapacity - send_.size(); }
  uint64_t lost_to_device() const { return lost_to_device_; }
  uint64_t lost_to_host() const { return lost_to_host_; }

 private:
  static constexpr double kBitsPerByte = 10.0;

  static constexpr uint32_t kRomBaud = 115200;

  static size_t take(std::deque<uint8_t>& queue, uint8_t* out, size_t capacity) {
    const size_t count = std::min(capacity, queue.size());
    const auto end = queue.begin() + static_cast<std::ptrdiff_t>(count);
    std::copy(queue.begin(), end, out);
    queue.erase(queue.begin(), end);
    return count;
  }

  /// How many of the queued bytes arrive within `seconds`.
  size_t wire_share(double seconds, size_t queued, double& credit) const {
    if (baud_ == 0) return queued;
    credit += seconds * baud_ / kBitsPerByte;
    const size_t whole = std::min(queued, static_cast<size_t>(credit));
    // Time in which the wire was idle is not credited.
    credit = whole == queued ? 0.0 : credit - static_cast<double>(whole);
    return whole;
  }

  double seconds_for(size_t queued, double credit) const {
    if (baud_ == 0 || queued == 0) return 0.0;
    return (static_cast<double>(queued) - credit) * kBitsPerByte / baud_;
  }

  void deliver_to_host(uint8_t byte) {
    if (to_host_.size() < kHostCapacity) {
      to_host_.push_back(byte);
    } else {
      ++lost_to_host_;
    }
  }

  LineTap* tap_ = nullptr;
  uint32_t baud_ = 0;
  std::deque<uint8_t> wire_to_device_;
  std::deque<uint8_t> receive_;
  std::deque<uint8_t> send_;
  std::deque<uint8_t> to_host_;
  double credit_to_device_ = 0.0;  ///< Part of a byte that is on the wire.
  double credit_to_host_ = 0.0;
  uint64_t lost_to_device_ = 0;
  uint64_t lost_to_host_ = 0;
};

}  // namespace wheelwire::sim
