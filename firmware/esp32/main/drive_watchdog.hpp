// The last resort while driving, where no interrupt comes any more: the RTC watchdog resets the
// chip. It runs on a clock of its own and needs no core; reset, the pins float and the pull-downs
// hold EN low until the bootloader does.
#pragma once

namespace wheelwire {

void prepare_drive_watchdog();

/// After a control step that drives: the next one is due within 18 ms. Arms it again if need be.
void feed_drive_watchdog();

/// Nothing drives. Also for interrupts and the panic handler.
void disarm_drive_watchdog();

}  // namespace wheelwire
