// The data-ready output of a chip on a pin of this one: its interrupt keeps the time, and nothing
// more.
#pragma once

#include "freertos/FreeRTOS.h"
#include "i2c_sensors.hpp"

namespace wheelwire {

class DataReadyPin final : public DataReady {
 public:
  /// Before the first one starts. Its interrupt also comes while a flash write has the cache off.
  static bool start_interrupts();
  bool start(int pin);

  uint64_t edge_us() override;

 private:
  static void on_edge(void* self);

  portMUX_TYPE lock_ = portMUX_INITIALIZER_UNLOCKED;
  uint64_t edge_us_ = 0;  // Two words: read and written under the lock.
};

}  // namespace wheelwire
