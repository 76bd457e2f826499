// The host at the other end of the UART: opens a session, drives, and asks.
#pragma once

#include <algorithm>

#include "driver/uart.h"
#include "esp_timer.h"
#include "robot_bench.hpp"

namespace wheelwire::hil {

class HostEnd final : public test::BenchHost {
 public:
  static constexpr int64_t kSetpointUs = 20'000;
  static constexpr int64_t kLifeUs = 100'000;
  /// What the driver's buffer on the chip holds; what comes while it is full is lost.
  static constexpr size_t kBuffer = 2048;

  int16_t duty_q15 = 0;  ///< 0: it sends zeros.
  bool sends_setpoints = true;
  int64_t pings_every_us = 0;  ///< 0: none.

  // What it has seen.
  bool is_open = false;
  uint32_t pings = 0;
  uint32_t pongs = 0;
  uint32_t acks = 0;
  int64_t heard_us = 0;          ///< When the last pong came.
  int64_t longest_pause_us = 0;  ///< Between two pongs.
  int64_t deadline_us = 0;       ///< Of the last setpoint.

  void advance() {
    listen();
    if (!is_open) {
      if (fake_time_us >= next_us_) {
        greet(kNonce, false);
        next_us_ = fake_time_us + kLifeUs;
      }
    } else if (sends_setpoints && fake_time_us >= next_us_) {
      next_us_ = fake_time_us + kSetpointUs;
      deadline_us = fake_time_us + kLifeUs;
      send(SetDuty{session_id(), ++command_seq_, static_cast<uint64_t>(deadline_us), duty_q15,
                   duty_q15});
    }
    if (is_open && pings_every_us != 0 && fake_time_us >= next_ping_us_) {
      next_ping_us_ = fake_time_us + pings_every_us;
      ping();
    }
    service();
  }

  void ping() {
    ++pings;
    send(Ping{session_id(), ++ping_id_, static_cast<uint64_t>(fake_time_us)});
  }
  void save() {
    send(ParameterSave{session_id(), ++request_id, 0});
    service();
  }
  /// What it sends is in the chip's buffer.
  void service() override {
    auto& buffer = fake_uart.received;
    for (const uint8_t byte : line.to_device)
      if (buffer.size() < kBuffer) buffer.push_back(byte);
    line.to_device.clear();
  }

 private:
  void listen() {
    line.to_host.swap(fake_uart.sent);
    collect();
    for (const DeviceHello& hello : of<DeviceHello>()) {
      is_open = hello.refusal == RefusalCode::kNone;
      if (is_open) ping();  // Or no setpoint is obeyed.
    }
    for ([[maybe_unused]] const Pong& pong : of<Pong>()) {
      if (pongs++ > 0) longest_pause_us = std::max(longest_pause_us, fake_time_us - heard_us);
      heard_us = fake_time_us;
    }
    acks += static_cast<uint32_t>(of<Ack>().size());
    received.clear();
  }

  uint16_t ping_id_ = 0;  // Apart: a request far ahead of the newest one counts as an old one.
  uint32_t command_seq_ = 0;
  int64_t next_us_ = 0;
  int64_t next_ping_us_ = 0;
};

}  // namespace wheelwire::hil
