// Crashes and hangs of each core while the robot drives.
#include "json.hpp"
#include "rows.hpp"
#include "virtual_chip.hpp"

namespace wheelwire::hil {
namespace {

constexpr int64_t kEventUs = 500'000;    ///< Then this happens.
constexpr int64_t kRestUs = 20'000'000;  ///< Until the black box is in flash.
constexpr int64_t kPhaseUs = 100;        ///< Not at the same time of a control period each time.

const char* name_of(ResetReason reason) {
  switch (reason) {
    case ResetReason::kPanic:
      return "PANIC";
    case ResetReason::kTaskWatchdog:
      return "TASK_WATCHDOG";
    case ResetReason::kInterruptWatchdog:
      return "INTERRUPT_WATCHDOG";
    default:
      return "UNKNOWN";
  }
}

struct Event {
  int core;
  bool hangs;
  Panic how;
};

std::vector<Event> events_of(int times) {
  std::vector<Event> events;
  for (int time = 0; time < times; ++time) {
    for (const int core : {0, 1}) {
      for (const Panic how :
           {Panic::kWrites, Panic::kLocked, Panic::kDumpHangs, Panic::kInterrupted, Panic::kWrites})
        events.push_back({core, false, how});
      for (int i = 0; i < 3; ++i) events.push_back({core, true, Panic::kWrites});
    }
  }
  return events;
}

/// Drives until the event, in the chip's next run.
End run_until(VirtualChip& chip, const Event& event, int64_t phase_us, bool& drove) {
  return chip.run([&] {
    if (chip.since_start_us() > kDriveUs) chip.host().duty_q15 = kDuty_q15;
    if (chip.since_start_us() < kEventUs + phase_us) return;
    drove = chip.drives() && chip.device().state() == SupervisorState::kDriving;
    if (event.hangs) chip.hang(event.core);
    chip.crash(event.core, event.how);
  });
}

}  // namespace

std::string measure_crashes(int times) {
  VirtualChip chip;
  std::vector<Json> measured;
  bool is_dead = false;
  const std::vector<Event> events = events_of(times);
  for (size_t i = 0; i < events.size(); ++i) {
    const Event& event = events[i];
    bool drove = false;
    const End end = run_until(chip, event, kPhaseUs * static_cast<int64_t>(i % 10), drove);
    const int64_t event_us = chip.event_us();
    const int64_t released_us = chip.released_us();
    // The next start is the one that comes back. The last one goes on, until its box is in flash.
    int64_t heard_us = -1;
    const int64_t rest_us = i + 1 == events.size() ? kRestUs : 0;
    if (end == End::kReset)
      chip.run([&] {
        if (!chip.host().is_open) return;
        if (heard_us < 0) heard_us = fake_time_us;
        chip.host().sends_setpoints = false;
        if (chip.since_start_us() > rest_us) chip.stop();
      });
    is_dead = end != End::kReset;
    Json result;
    result.put("core", event.core)
        .put("kind", quoted(event.hangs ? "hang" : "crash"))
        .put("drove", drove)
        .put("is_back", !is_dead);
    if (released_us >= 0)
      result.put("released_ms", static_cast<double>(released_us - event_us) / 1e3);
    if (!is_dead) {
      result.put("back_s", static_cast<double>(heard_us - event_us) / 1e6)
          .put("reason", quoted(name_of(chip.last_reset().reason)))
          .put("has_dump", chip.last_reset().has_dump);
    }
    measured.push_back(result);
    if (is_dead) break;  // Somebody has to press its button.
  }
  Json row;
  row.put("events", measured);
  if (!is_dead) {
    row.put("boxes", chip.newest_box().box_count)
        .put("box_reason", quoted(name_of(chip.newest_box().reset_reason)))
        .put("box_is_of_reset", chip.newest_box().cause == BoxCause::kReset);
  }
  return row.text();
}

}  // namespace wheelwire::hil
