// The line to the host: UART0, or the chip's own USB where it has one. The board says which.
#pragma once

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "hal.hpp"

namespace wheelwire {

/// For the control task only. The driver's interrupt fills the driver's own buffer.
class Line : public ByteStream {
 public:
  virtual bool start() = 0;
  /// From now on `task` is notified with `bits` when bytes arrive.
  virtual void notify(TaskHandle_t task, uint32_t bits) = 0;
  /// Hands waiting bytes to the hardware, which may take only a few at a time.
  virtual void push() = 0;
};

/// UART0, behind a DevKit's USB bridge.
class UartLine final : public Line {
 public:
  bool start() override;
  void notify(TaskHandle_t task, uint32_t bits) override;
  void push() override;

  size_t read(uint8_t* out, size_t capacity) override;
  bool write(const uint8_t* data, size_t size) override;
  uint32_t bytes_per_second() const override;
};

/// USB-Serial-JTAG, which ESP32-S3 and ESP32-C6 have.
class UsbLine final : public Line {
 public:
  bool start() override;
  void notify(TaskHandle_t task, uint32_t bits) override;
  void push() override {}  // The driver's interrupt does it.

  size_t read(uint8_t* out, size_t capacity) override;
  bool write(const uint8_t* data, size_t size) override;
  uint32_t bytes_per_second() const override { return 0; }
};

}  // namespace wheelwire
