#include "fail_core.hpp"

#include <stdlib.h>

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"

namespace wheelwire {

void fail_core(Failure failure) {
  switch (failure) {
    case Failure::kNone:
      return;
    case Failure::kCrash:
      abort();
    case Failure::kHang:
      vTaskSuspendAll();  // Of this core alone.
      break;
    case Failure::kFreeze:
      portDISABLE_INTERRUPTS();
      break;
  }
  for (;;) asm volatile("");
}

}  // namespace wheelwire
