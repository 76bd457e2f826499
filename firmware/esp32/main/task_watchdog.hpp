// The task watchdog: a task that hangs ends in a panic, and that in a silent restart. (The command
// watchdog, which stops a robot whose host is gone, is the core's.)
#pragma once

namespace wheelwire {

bool start_task_watchdog();

/// Watches the calling task, which from now on feeds it.
bool watch_this_task();
void feed_task_watchdog();

/// While it exists, tasks may stand still for longer: a flash write stalls both cores, and a
/// sector's erasure takes up to some hundred milliseconds. The core lets it happen only while
/// stopped, and the dead-man holds EN low meanwhile.
class SlowOperation {
 public:
  SlowOperation();
  ~SlowOperation();
  SlowOperation(const SlowOperation&) = delete;
  SlowOperation& operator=(const SlowOperation&) = delete;
};

}  // namespace wheelwire
