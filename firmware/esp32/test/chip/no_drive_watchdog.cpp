// The drive's watchdog is registers alone: nothing of it can run here.
#include "drive_watchdog.hpp"

namespace wheelwire {

void feed_drive_watchdog() {}
void disarm_drive_watchdog() {}

}  // namespace wheelwire
