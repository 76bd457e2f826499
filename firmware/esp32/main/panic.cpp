// A panic ends in a restart by software, which leaves the PWM running until the bootloader's hook:
// so the motors are let go first.
#include "enable_pins.hpp"
#include "esp_attr.h"

// The linker's option --wrap gives these names.
extern "C" void __real_esp_panic_handler(void* info);

extern "C" IRAM_ATTR void __wrap_esp_panic_handler(void* info) {
  wheelwire::hold_enables_low();
  __real_esp_panic_handler(info);
}
