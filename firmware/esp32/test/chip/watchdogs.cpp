#include "watchdogs.hpp"

#include "drive_watchdog.hpp"
#include "task_watchdog.hpp"

namespace wheelwire {

SlowOperation::SlowOperation() {}
SlowOperation::~SlowOperation() {}
bool watch_this_task() { return true; }
void feed_task_watchdog() { ++test::task_watchdog_feeds; }
void feed_drive_watchdog() { ++test::drive_watchdog_feeds; }
void disarm_drive_watchdog() {}

}  // namespace wheelwire
