#include "virtual_chip.hpp"

#include <string.h>

#include <algorithm>
#include <vector>

#include "control_task.hpp"
#include "drive_watchdog.hpp"
#include "esp_attr.h"
#include "esp_rom_sys.h"
#include "esp_task_wdt.h"
#include "freertos/FreeRTOS.h"
#include "hal/wdt_hal.h"
#include "latch_memory.hpp"
#include "nvs_store.hpp"
#include "partition_flash.hpp"
#include "pins.hpp"
#include "recorder_keeper.hpp"
#include "stage_boards.hpp"
#include "task_watchdog.hpp"

extern "C" void bootloader_before_init();

// Either the entries of the handler are wrapped, or what is called after the stall.
extern "C" [[gnu::weak]] void __wrap_panicHandler(void* frame);
extern "C" [[gnu::weak]] void __wrap_esp_panic_handler(void* info);

namespace wheelwire::hil {
namespace {

constexpr int64_t kTickUs = 100;
constexpr int64_t kControlPeriodUs = 1000;
constexpr int64_t kBootUs = 300'000;
constexpr int64_t kDumpUs = 600'000;
/// A core that executes nothing is noticed by the slower watchdogs.
constexpr int64_t kSlowWatchdogUs = 300'000;
// Where in each millisecond the cores' dead-men look.
constexpr int64_t kDeadManUs[] = {300, 700};

/// The handler of ESP-IDF that is under way.
std::function<void()> panic_handler;

RecorderMemory recorder_memory;

struct NoBattery final : BatterySense {
  uint16_t millivolts() override { return 0; }
};
struct Stopped {};
struct Dead {};

/// Memory as start-up code sets it up.
void initialise_memory() {
  static const std::vector<uint8_t> initial(__start_fake_dram, __stop_fake_dram);
  std::copy(initial.begin(), initial.end(), __start_fake_dram);
}

}  // namespace

VirtualChip::VirtualChip() : board_(test::board_of(Stage::kEnableIn1In2)) {
  fake_time_us = 1'000'000;
  memset(&recorder_memory, 0x5a, sizeof recorder_memory);
  fake_partition = blank_partition("recorder", RecorderKeeper::kFlashSize);
}

End VirtualChip::run(const std::function<void()>& plan) {
  plan_ = plan;
  fake_time_us = (fake_time_us + kBootUs) / kControlPeriodUs * kControlPeriodUs;
  start_us_ = fed_us_ = fake_time_us;
  stopped_core_ = -1;
  is_locked_ = false;
  if (reset_.clears_pins) fake_matrix = {};
  bootloader_before_init();
  initialise_memory();
  fake_rwdt = {};  // The bootloader's, which ends when the firmware configures it.
  fake_on_delay = nullptr;
  fake_uart = {};
  fake_pcnt.clear();
  timers_[0] = timers_[1] = nullptr;
  panic_handler = [this] { handle_panic(); };

  float_pins();
  take_pins(ConfigurationState::kStored, board_);
  WiredRobot robot{board_};
  UartLine line;
  line.start();
  NvsStore store{"parameters"};
  NvsStore latch_store{"latch"};
  store.start();
  latch_store.start();
  RtcLatchMemory latches;
  NoBattery battery;
  robot.start(Parameters{});
  prepare_drive_watchdog();
  start_task_watchdog();
  DeadMan dead_man;
  fake_core = 0;
  dead_man.watch_from_this_core();
  timers_[0] = fake_newest_timer;
  Identity identity{};
  identity.boot_id = HostEnd::kBootId;
  identity.reset_reason = reset_.reason;
  Device device{{.left_motor = robot.left_motor,
                 .right_motor = robot.right_motor,
                 .encoders = robot.encoders,
                 .line = line,
                 .store = store,
                 .latches = latches,
                 .latch_store = latch_store,
                 .estop = robot.estop,
                 .battery = battery},
                identity};
  PartitionFlash flash;
  flash.start(RecorderKeeper::kFlashSize);
  RecorderKeeper recorder{recorder_memory, flash, {}, reset_.reason, 0};
  SharedState state;
  ControlTask control{device, line, dead_man, state, &recorder};
  HostEnd host;
  device_ = &device;
  host_ = &host;
  fake_wait = [this](TickType_t) { return wait(); };
  End end = End::kDone;
  try {
    control.start();
  } catch (const Stopped&) {
  } catch (const Dead&) {
    end = End::kDead;
  } catch (const Reset& reset) {
    reset_ = reset;
    end = End::kReset;
  }
  if (end == End::kDone) recorder.describe(newest_);
  fake_wait = nullptr;
  fake_core = 0;
  // The motors of a chip that was reset are off, at the latest.
  if (end == End::kReset && released_us_ < 0) released_us_ = fake_time_us;
  return end;
}

int64_t VirtualChip::since_start_us() const { return fake_time_us - start_us_; }

bool VirtualChip::drives() const {
  for (size_t wheel = 0; wheel < 2; ++wheel) {
    const auto high = [&](size_t input) {
      return fake_matrix.can_be_high(board_.pin(input_of(wheel, input)));
    };
    if (high(0) && high(1) != high(2)) return true;
  }
  return false;
}

void VirtualChip::stop() { throw Stopped{}; }

/// The control task waits: time passes, until it is woken.
uint32_t VirtualChip::wait() {
  constexpr uint32_t kStepDue = 1;
  constexpr uint32_t kBytesCame = 2;
  if (timers_[1] == nullptr) timers_[1] = fake_newest_timer;
  const size_t waiting = fake_uart.received.size();
  do {
    tick();
    if (fake_time_us % kControlPeriodUs == 0) {
      stepped_us_ = fake_time_us;
      return kStepDue;
    }
  } while (fake_uart.received.size() == waiting);
  return kBytesCame;
}

void VirtualChip::tick() {
  fake_time_us += kTickUs;
  host_->advance();
  for (const int core : {0, 1}) ring(core);
  note_release();
  check_watchdogs();
  plan_();
}

void VirtualChip::ring(int core) {
  if (core == stopped_core_ || timers_[core] == nullptr) return;
  if (fake_time_us % kControlPeriodUs != kDeadManUs[core]) return;
  const int here = fake_core;
  fake_core = core;
  timers_[core]->ring();
  fake_core = here;
}

void VirtualChip::note_release() {
  if (released_us_ < 0 && !drives()) released_us_ = fake_time_us;
}

void VirtualChip::check_watchdogs() {
  const int feeds = fake_task_watchdog.feeds + fake_task_watchdog.restarts;
  if (feeds_ != feeds) {
    feeds_ = feeds;
    fed_us_ = fake_time_us;
  }
  check_rwdt();
  if (stopped_core_ < 0 && fake_time_us - fed_us_ > int64_t{1000} * fake_task_watchdog.timeout_ms)
    throw Reset{ResetReason::kTaskWatchdog, true, false};
  if (stopped_core_ >= 0 && fake_time_us - event_us_ > kSlowWatchdogUs)
    throw Reset{ResetReason::kTaskWatchdog, false, true};
}

/// A reset of the system leaves what stalls the other core, and with it memory that is locked.
void VirtualChip::check_rwdt() {
  for (const wdt_stage_t stage : {WDT_STAGE0, WDT_STAGE1, WDT_STAGE2, WDT_STAGE3}) {
    const rwdt_dev_t::Expiry expiry = fake_rwdt.expiry(stage);
    if (expiry.action == WDT_STAGE_ACTION_OFF || expiry.at_us > fake_time_us) return;
    if (expiry.action == WDT_STAGE_ACTION_RESET_RTC || !is_locked_)
      throw Reset{ResetReason::kInterruptWatchdog, false, true};
  }
}

void VirtualChip::hang(int core) {
  expect_release();
  stopped_core_ = core;
  for (;;) {
    fake_time_us += kTickUs;
    for (const int other : {0, 1}) ring(other);
    note_release();
    check_watchdogs();
  }
}

void VirtualChip::crash(int core, Panic how) {
  expect_release();
  how_ = how;
  fake_core = core;
  if (how == Panic::kInterrupted) {
    // The other core goes on until it is stalled.
    fake_rwdt.on_access = disarm_drive_watchdog;
  }
  if (__wrap_panicHandler != nullptr) __wrap_panicHandler(nullptr);
  handle_panic();
}

/// What panic_handler.c and panic.c of ESP-IDF 5.5.3 do.
void VirtualChip::handle_panic() {
  note_release();
  fake_rwdt.on_access = nullptr;
  fake_panic_arms_watchdog();
  if (how_ == Panic::kInterrupted) disarm_drive_watchdog();
  // The stall.
  is_locked_ = how_ == Panic::kLocked;
  if (!is_locked_ && __wrap_esp_panic_handler != nullptr) __wrap_esp_panic_handler(nullptr);
  const bool ends = !is_locked_ && how_ != Panic::kDumpHangs;
  for (const int64_t dump_us = fake_time_us + kDumpUs; !ends || fake_time_us < dump_us;) {
    fake_time_us += kControlPeriodUs;
    note_release();
    check_rwdt();
    if (!ends && !fake_rwdt.is_enabled) throw Dead{};
    if (fake_time_us - event_us_ > 60'000'000) throw Dead{};
  }
  throw Reset{ResetReason::kPanic, true, false};
}

}  // namespace wheelwire::hil

extern "C" void __real_panicHandler(void*) { wheelwire::hil::panic_handler(); }
extern "C" void __real_xt_unhandled_exception(void*) { wheelwire::hil::panic_handler(); }
extern "C" void __real_esp_panic_handler(void*) {}
