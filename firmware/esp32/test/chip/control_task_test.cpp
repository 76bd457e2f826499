// The control task's loop in virtual time, with a timer that fails.
#include "control_task.hpp"

#include <algorithm>
#include <map>
#include <vector>

#include "esp_system.h"
#include "esp_task_wdt.h"
#include "fake_line.hpp"
#include "partition_flash.hpp"
#include "pins.hpp"
#include "recorder_keeper.hpp"
#include "stage_boards.hpp"
#include "task_watchdog.hpp"
#include "wired_robot.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr uint32_t kBytesCame = 2;
constexpr int64_t kTaskWatchdogUs = 100'000;

/// A robot at rest, with all that a task needs.
struct Rig {
  const BoardDescription board = board_of(Stage::kEnableIn1In2);
  WiredRobot robot{board};
  FakeLine line;
  MemoryStore store;
  MemoryLatches latches;
  MemoryStore latch_store;
  BenchBattery battery;
  Device device = device_on(line);

  Device device_on(Line& any) {
    Identity identity = RobotBench::kIdentity;
    identity.capabilities = capability::kRestart;
    return Device{{.left_motor = robot.left_motor,
                   .right_motor = robot.right_motor,
                   .encoders = robot.encoders,
                   .line = any,
                   .store = store,
                   .latches = latches,
                   .latch_store = latch_store,
                   .estop = robot.estop,
                   .battery = battery},
                  identity};
  }
  bool start() {
    fake_matrix = {};
    return take_pins(ConfigurationState::kStored, board) && robot.start(Parameters{});
  }
};

/// Runs the task for a second, in which bytes come every `bytes_every_us`, and no timer ever wakes
/// it. Returns the longest time without a step.
int64_t longest_without_a_step_us(Device& device, int64_t bytes_every_us) {
  static FakeLine line;
  static DeadMan dead_man;
  static SharedState state;
  ControlTask task{device, line, dead_man, state, nullptr};
  const int64_t start_us = fake_time_us = 500'000;
  int64_t fed_us = start_us;
  int64_t longest_us = 0;
  int feeds = fake_task_watchdog.feeds;
  fake_wait = [&](TickType_t ticks) -> uint32_t {
    if (feeds != fake_task_watchdog.feeds) {
      feeds = fake_task_watchdog.feeds;
      fed_us = fake_time_us;
    }
    const int64_t timeout_us = int64_t{1000} * ticks;
    fake_time_us += std::min(timeout_us, bytes_every_us);
    longest_us = std::max(longest_us, fake_time_us - fed_us);
    if (fake_time_us > start_us + 1'000'000) throw EndOfTask{};
    return bytes_every_us <= timeout_us ? kBytesCame : 0;
  };
  CHECK(fake_run([&] { task.start(); }));
  return longest_us;
}

RecorderMemory recorder_memory;

/// A chip that starts after `reason`, with its task, its recorder and a host on its line.
struct StartedChip {
  StartedChip(ResetReason reason, Line& line)
      : device(rig.device_on(line)),
        recorder(recorder_memory, flash, {}, reason, 0),
        task(device, line, dead_man, state, &recorder) {
    CHECK(rig.start() && start_task_watchdog() && flash.start(RecorderKeeper::kFlashSize));
  }
  StartedChip(const StartedChip&) = delete;
  ~StartedChip() { fake_partition.on_call = {}; }

  /// From half a second after the start on. `each_ms` is called each millisecond.
  void run_until(int64_t end_us, auto each_ms) {
    fake_time_us = 500'000;
    fake_wait = [&](TickType_t) -> uint32_t {
      fake_time_us += 1'000;
      each_ms();
      if (fake_time_us > end_us) throw EndOfTask{};
      return 1;
    };
    CHECK(fake_run([&] { task.start(); }));
  }

  Rig rig;
  Device device;
  PartitionFlash flash;
  RecorderKeeper recorder;
  DeadMan dead_man;
  SharedState state;
  ControlTask task;
};

void blank_flash() { fake_partition = blank_partition("recorder", RecorderKeeper::kFlashSize); }

/// A host that opens a session, asks ten times a second, and notes how long each answer took.
class AskingHost final : public BenchHost, public FakeLine {
 public:
  AskingHost() : FakeLine(BenchHost::line) {}

  std::vector<int64_t> waits_us;
  int64_t restarts_us = INT64_MAX;  ///< When it asks for a restart.

  /// Sends what is due by now.
  void advance() {
    if (next_us_ == 0) {
      greet(kNonce, false);
      next_us_ = fake_time_us + kIntervalUs;
    }
    for (; next_us_ <= fake_time_us; next_us_ += kIntervalUs) {
      send(GroupGet{session_id(), ++request_id, Group::kRecorder});
      sent_us_[request_id] = next_us_;
      if (next_us_ >= restarts_us) send(Restart{session_id(), ++request_id});
    }
  }
  bool write(const uint8_t* data, size_t size) override {
    received.clear();
    const bool is_taken = FakeLine::write(data, size);
    collect();
    for (const GroupInfo& info : of<GroupInfo>())
      waits_us.push_back(fake_time_us - sent_us_.at(info.request_id));
    return is_taken;
  }
  void service() override {}  // Its task reads the line.

 private:
  static constexpr int64_t kIntervalUs = 100'000;

  int64_t next_us_ = 0;
  std::map<uint16_t, int64_t> sent_us_;
};

}  // namespace

TEST(a_robot_without_its_timer_steps_late_and_reports_why) {
  for (const bool can_create : {false, true}) {
    for (const int64_t bytes_every_us : {300, 10'000, 49'000, 60'000, 10'000'000}) {
      fake_timer_creation = can_create ? ESP_OK : ESP_FAIL;
      fake_timer_start = ESP_FAIL;
      Rig rig;
      CHECK(rig.start());
      CHECK(longest_without_a_step_us(rig.device, bytes_every_us) < kTaskWatchdogUs * 6 / 10);
      CHECK(rig.device.faults() & fault::kDriverFailed);
      CHECK(rig.device.state() == SupervisorState::kFault);
    }
  }
  fake_timer_creation = fake_timer_start = ESP_OK;
}

TEST(a_host_is_answered_between_the_operations_of_a_box_s_write) {
  constexpr int64_t kEraseUs = 400'000;
  blank_flash();
  std::fill(fake_partition.bytes.begin(), fake_partition.bytes.end(), uint8_t{0x5a});
  AskingHost host;
  StartedChip chip(ResetReason::kPowerOn, host);
  int calls = 0;
  int most_calls = 0;
  bool is_started = false;
  int64_t erased_us = 0;
  int64_t shortest_rest_us = INT64_MAX;
  fake_partition.on_call = [&](bool erases) {
    ++calls;
    if (!erases) return;
    CHECK(int64_t{1000} * fake_task_watchdog.timeout_ms > kEraseUs);
    shortest_rest_us = std::min(shortest_rest_us, fake_time_us - erased_us);
    erased_us = fake_time_us += kEraseUs;
  };
  chip.run_until(40'500'000, [&] {
    if (is_started) most_calls = std::max(most_calls, calls);
    is_started = true;
    calls = 0;
    if (fake_time_us >= 2'000'000) chip.device.report_driver_failure();
    host.advance();
  });
  CHECK(chip.recorder.store().count() == 1 && fake_partition.erasures > 16);
  CHECK(most_calls == 2);  // A change and a read: a machine on which each is slow answers, too.
  CHECK(shortest_rest_us >= kEraseUs);
  CHECK(host.waits_us.size() >= 398);
  CHECK(*std::max_element(host.waits_us.begin(), host.waits_us.end()) <= kEraseUs + 2'000);
  fake_partition = {};
}

TEST(a_restart_that_is_asked_for_leaves_no_box_to_a_boot_that_crashes_at_once) {
  blank_flash();
  AskingHost host;
  host.restarts_us = 2'000'000;
  StartedChip chip(ResetReason::kPowerOn, host);
  bool restarted = false;
  fake_restart = [&] {
    restarted = true;
    throw EndOfTask{};
  };
  chip.run_until(20'000'000, [&] { host.advance(); });
  fake_restart = [] {};
  CHECK(restarted);
  RecorderKeeper next{recorder_memory, chip.flash, {}, ResetReason::kPanic, 0};
  next.start();
  CHECK(!next.black_box().is_closed());  // It records, and holds nothing back.
  fake_partition = {};
}
