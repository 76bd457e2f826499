// What the code under test does to the watchdogs.
#pragma once

namespace wheelwire::test {

inline int task_watchdog_feeds = 0;
inline int drive_watchdog_feeds = 0;

}  // namespace wheelwire::test
