// Below the scheduler: when no control step has run for some time, a timer's interrupt holds EN
// low. It needs no task, no flash and no driver.
#pragma once

#include "driver/gptimer.h"

namespace wheelwire {

class DeadMan {
 public:
  /// The interrupt comes to the core that calls this: not the one of the control task, where there
  /// are two, so that it comes even when that one has its interrupts off.
  bool start();
  /// A control step ran.
  void feed() { gptimer_set_raw_count(timer_, 0); }
  /// How long none may run. The first call begins the watch.
  bool set_limit(uint32_t limit_us);

 private:
  gptimer_handle_t timer_ = nullptr;
  bool watching_ = false;
};

}  // namespace wheelwire
