// The task watchdog: a task that hangs causes a panic, and that a silent restart. (The command
// watchdog, which stops a robot whose host is gone, is in the core.)
#pragma once

namespace wheelwire {

bool start_task_watchdog();

/// Watches the calling task, which must feed it from now on.
bool watch_this_task();
void feed_task_watchdog();

/// While one exists, tasks may stall for longer: flash access stalls both cores, and erasing a
/// sector takes up to some hundred milliseconds. The core writes only while stopped; during a
/// write, the dead-man holds EN low or leaves a brake on.
class SlowOperation {
 public:
  SlowOperation();
  ~SlowOperation();
  SlowOperation(const SlowOperation&) = delete;
  SlowOperation& operator=(const SlowOperation&) = delete;
};

}  // namespace wheelwire
