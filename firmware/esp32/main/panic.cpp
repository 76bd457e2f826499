// A panic ends in a software restart, which leaves the PWM running until the bootloader's hook: so
// the motors coast first.
#include "drive_watchdog.hpp"
#include "esp_attr.h"
#include "release_pins.hpp"

// The names come from the linker's option --wrap.
extern "C" void __real_esp_panic_handler(void* info);

extern "C" IRAM_ATTR void __wrap_esp_panic_handler(void* info) {
  wheelwire::release_motors();
  // It would cut the core dump short. The handler uses the same watchdog with a longer time-out.
  wheelwire::disarm_drive_watchdog();
  __real_esp_panic_handler(info);
}
