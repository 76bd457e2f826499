// The line to the host: UART0 or the chip's own USB, chosen by the build.
#pragma once

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "hal.hpp"

namespace wheelwire {

/// For the control task only. The driver's interrupt fills the driver's own buffer.
class Line final : public ByteStream {
 public:
  bool start();
  /// From now on `task` is notified with `bits` when bytes arrive.
  void notify(TaskHandle_t task, uint32_t bits);
  /// Hands waiting bytes to the hardware, which may take only a few at a time.
  void push();

  size_t read(uint8_t* out, size_t capacity) override;
  bool write(const uint8_t* data, size_t size) override;
  uint32_t bytes_per_second() const override;
};

}  // namespace wheelwire
