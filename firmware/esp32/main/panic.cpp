// A panic ends in a software restart, which leaves the PWM running until the bootloader's hook. So
// this first makes the motors coast. Then it arms a watchdog that also resets the registers that
// stall a core. The IDF's handler is about to stall the other core, and a core stalled within an
// atomic instruction (s32c1i) keeps its part of the memory locked.
// Both entries of the handler are wrapped; only the vectors run before them
// (components/esp_system/port/panic_handler.c). esp_panic_handler() comes after the stall, and from
// 5.4.2 on after the IDF's own watchdog is armed.
#include "drive_watchdog.hpp"
#include "esp_attr.h"
#include "esp_idf_version.h"
#include "release_pins.hpp"

// 5.4.1 leaves a chip dead whose panic stalled a core at the wrong moment (cd887ef59a7 repairs it:
// espressif/esp-idf 10110, 15018, 15166), panics a second time while it writes a core dump on a
// stack of its own (4f9943e8e4b), and runs an ESP32 at 240 MHz on the voltage of its eFuse
// (bb8a86856a0). 5.5.2 still has the second fault. Of those that PlatformIO offers, 5.5.3 is the
// first without any of them, and the one that this firmware was checked against.
#if ESP_IDF_VERSION < ESP_IDF_VERSION_VAL(5, 5, 3)
#error \
    "Build the firmware with ESP-IDF 5.5.3 or later: platformio.ini and .github/workflows/ci.yml have it; delete the build folder and build again"
#endif

// The names come from the linker's option --wrap.
extern "C" void __real_panicHandler(void* frame);
extern "C" void __real_xt_unhandled_exception(void* frame);

namespace {

/// Inlined: the cache may be off.
[[gnu::always_inline]] inline void prepare_for_panic() {
  wheelwire::release_motors();
  wheelwire::guard_panic();
}

}  // namespace

/// Interrupt watchdog, cache errors, double exceptions.
extern "C" IRAM_ATTR void __wrap_panicHandler(void* frame) {
  prepare_for_panic();
  __real_panicHandler(frame);
}

/// All other exceptions, abort() and the task watchdog among them.
extern "C" IRAM_ATTR void __wrap_xt_unhandled_exception(void* frame) {
  prepare_for_panic();
  __real_xt_unhandled_exception(frame);
}
