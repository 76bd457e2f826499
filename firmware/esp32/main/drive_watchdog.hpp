// The last resort, for when no interrupt is served any more: the RTC watchdog resets the chip. It
// has its own clock and needs no core. In reset the pins float, and the pull-downs hold EN low
// until the bootloader does. docs/adr/0026 says what each kind of reset leaves.
#pragma once

namespace wheelwire {

void prepare_drive_watchdog();

/// Call after a control step that drives: the next one is due within 18 ms. Arms the watchdog if it
/// is not armed. If a system reset at 18 ms does not help, the whole chip is reset a second later.
void feed_drive_watchdog();

/// Call when nothing drives. Also for interrupts.
void disarm_drive_watchdog();

/// For the panic handler, before anything else: the chip resets in 10 s, whatever happens until
/// then. The functions above can no longer change that.
void guard_panic();

}  // namespace wheelwire
