// What can wait: the status LED and the battery. Lowest priority, under the task watchdog, so that
// a core on which no task runs any more is noticed, too.
#pragma once

#include "battery.hpp"
#include "shared_state.hpp"

namespace wheelwire {

class Housekeeping {
 public:
  Housekeeping(Battery& battery, SharedState& state) : battery_(battery), state_(state) {}

  /// Creates the task, which owns the battery from here on.
  void start(bool has_battery, int led_pin);

 private:
  [[noreturn]] static void run(void* self);
  void run_once();

  Battery& battery_;
  SharedState& state_;
  bool has_battery_ = false;
  int led_pin_ = -1;
  uint32_t cycles_ = 0;
};

}  // namespace wheelwire
