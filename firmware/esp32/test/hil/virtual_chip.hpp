// A whole chip in virtual time, from reset to reset: main/*.cpp on the stand-ins of the chip tests,
// two cores with their dead-men, the RTC watchdog, the panic handler of ESP-IDF 5.5.3, and a host
// that drives it over the UART.
#pragma once

#include <functional>
#include <optional>

#include "dead_man.hpp"
#include "device.hpp"
#include "hal/rwdt_ll.h"
#include "host_end.hpp"
#include "wired_robot.hpp"

namespace wheelwire::hil {

/// How far the panic handler comes.
enum class Panic {
  kWrites,       ///< It writes a core dump and restarts the chip.
  kLocked,       ///< The other core was stalled within an atomic instruction: memory is locked.
  kDumpHangs,    ///< The core dump never ends.
  kInterrupted,  ///< The other core's dead-man fires between the handler's first lines.
};

struct Reset {
  ResetReason reason;
  bool has_dump;     ///< A core dump is whole.
  bool clears_pins;  ///< A restart by software leaves them.
};

/// Why a run ended.
enum class End { kDone, kReset, kDead };

class VirtualChip {
 public:
  VirtualChip();

  /// A start of the chip, and its run until `plan` calls stop(), or the chip is reset, or dead:
  /// only its EN pin would help then. `plan` is called every 100 us.
  End run(const std::function<void()>& plan);

  // For the plan.
  [[noreturn]] void stop();
  [[noreturn]] void crash(int core, Panic how);
  [[noreturn]] void hang(int core);
  /// From now on the host sends no setpoint.
  HostEnd& host() { return *host_; }
  Device& device() { return *device_; }
  int64_t since_start_us() const;
  /// Whether a motor is driven at some time of a PWM period.
  bool drives() const;
  /// When the last control step began.
  int64_t stepped_us() const { return stepped_us_; }

  const Reset& last_reset() const { return reset_; }
  /// When something happened to the chip, and when the motors were off after it.
  int64_t event_us() const { return event_us_; }
  int64_t released_us() const { return released_us_; }
  void expect_release() {
    event_us_ = fake_time_us;
    released_us_ = -1;
  }
  /// The newest black box in flash.
  BoxValue newest_box() const { return newest_; }

 private:
  uint32_t wait();
  void tick();
  void ring(int core);
  void note_release();
  void check_watchdogs();
  void check_rwdt();
  [[noreturn]] void handle_panic();

  BoardDescription board_;
  Reset reset_{ResetReason::kPowerOn, false, true};
  BoxValue newest_{};
  int64_t start_us_ = 0;
  int64_t event_us_ = 0;
  int64_t released_us_ = 0;
  int64_t stepped_us_ = 0;
  int64_t fed_us_ = 0;
  int feeds_ = 0;
  int stopped_core_ = -1;
  bool is_locked_ = false;
  Panic how_ = Panic::kWrites;
  FakeGptimer* timers_[2]{};
  std::function<void()> plan_;
  Device* device_ = nullptr;
  HostEnd* host_ = nullptr;
};

}  // namespace wheelwire::hil
