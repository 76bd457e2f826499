// The last resort while driving, for when no interrupt is served any more: the RTC watchdog resets
// the chip. It has its own clock and needs no core. In reset the pins float, and the pull-downs
// hold EN low until the bootloader does.
#pragma once

namespace wheelwire {

void prepare_drive_watchdog();

/// Call after a control step that drives: the next one is due within 18 ms. Arms the watchdog if it
/// is not armed.
void feed_drive_watchdog();

/// Call when nothing drives. Also for interrupts and the panic handler.
void disarm_drive_watchdog();

}  // namespace wheelwire
