// A panic ends in a restart by software, which leaves the PWM running until the bootloader's hook:
// so the motors are let go first.
#include "drive_watchdog.hpp"
#include "enable_pins.hpp"
#include "esp_attr.h"

// The linker's option --wrap gives these names.
extern "C" void __real_esp_panic_handler(void* info);

extern "C" IRAM_ATTR void __wrap_esp_panic_handler(void* info) {
  wheelwire::hold_enables_low();
  // It would cut the core dump short; the handler uses the same watchdog with a longer time.
  wheelwire::disarm_drive_watchdog();
  __real_esp_panic_handler(info);
}
