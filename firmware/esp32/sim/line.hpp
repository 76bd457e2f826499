// The serial line between host and chip: bounded buffers on the chip, a wire of finite speed.
#pragma once

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

  size_t read(uint8_t* out, size_t capacity) override;
  bool write(const uint8_t* data, size_t size) override;
  uint32_t bytes_per_second() const override { return baud_ / 10; }

  uint32_t baud() const { return baud_; }
  /// 0: no limit, as on native USB.
  void set_baud(uint32_t baud) { baud_ = baud; }

  /// From now on the firmware reads no further than the next zero in one call, so that the tap sees
  /// each frame just before the firmware handles it.
  void set_tap(LineTap* tap) { tap_ = tap; }

  /// Bytes from the host onto the wire.
  void host_write(const uint8_t* data, size_t size);
  size_t host_read(uint8_t* out, size_t capacity);
  size_t host_waiting() const { return to_host_.size(); }

  /// Carries bytes over the wire for `seconds`. A device that is not `listening` loses what
  /// arrives.
  void carry(double seconds, bool listening);
  /// Until the last byte on either wire has arrived, whichever is first [s]; 0 when both are idle.
  double until_idle() const;
  /// Empties the chip's buffers, as a reset does.
  void reset();
  /// Bytes that the chip sends without the firmware, at its boot ROM's baud rate.
  void emit_from_rom(const Bytes& text);

  /// Whether the firmware can send this many bytes now.
  bool has_room(size_t size) const { return size <= kSendCapacity - send_.size(); }

  uint64_t lost_to_device() const { return lost_to_device_; }
  uint64_t lost_to_host() const { return lost_to_host_; }

 private:
  size_t wire_share(double seconds, size_t queued, double& credit) const;
  double seconds_for(size_t queued, double credit) const;
  void deliver_to_host(uint8_t byte);

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
