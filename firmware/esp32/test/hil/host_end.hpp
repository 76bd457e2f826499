// The host at the other end of the UART: opens a session, drives, and asks.
#pragma once

#include <stdint.h>

#include <algorithm>

#include "driver/uart.h"
#include "esp_timer.h"
#include "frames.hpp"

namespace wheelwire::hil {

class HostEnd {
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
        send(Hello{
            .nonce = kNonce, .protocol_version = schema::kVersion, .schema_hash = schema::kHash});
        next_us_ = fake_time_us + kLifeUs;
      }
      return;
    }
    if (sends_setpoints && fake_time_us >= next_us_) {
      next_us_ = fake_time_us + kSetpointUs;
      deadline_us = fake_time_us + kLifeUs;
      send(SetDuty{.session_id = kNonce,
                   .command_seq = ++command_seq_,
                   .expiry_us = static_cast<uint64_t>(deadline_us),
                   .left_duty_q15 = duty_q15,
                   .right_duty_q15 = duty_q15});
    }
    if (pings_every_us != 0 && fake_time_us >= next_ping_us_) {
      next_ping_us_ = fake_time_us + pings_every_us;
      ping();
    }
  }

  void ping() {
    ++pings;
    send(Ping{.session_id = kNonce,
              .request_id = ++ping_id_,
              .host_us = static_cast<uint64_t>(fake_time_us)});
  }
  void save() {
    send(ParameterSave{.session_id = kNonce, .request_id = ++request_id_, .parameter = 0});
  }

 private:
  static constexpr uint32_t kNonce = 0x1234;

  template <typename Message>
  void send(const Message& message) {
    const std::vector<uint8_t> frame = test::frame_of(message, seq_++);
    auto& buffer = fake_uart.received;
    const size_t room = kBuffer - std::min(kBuffer, buffer.size());
    const auto size = static_cast<ptrdiff_t>(std::min(frame.size(), room));
    buffer.insert(buffer.end(), frame.begin(), frame.begin() + size);
  }

  void listen() {
    Frame frame{};
    for (const uint8_t byte : fake_uart.sent)
      if (decoder_.feed(byte, frame)) take(frame);
    fake_uart.sent.clear();
  }
  void take(const Frame& frame) {
    switch (frame.id) {
      case DeviceHello::kId:
        is_open = DeviceHello::decode(frame.body).refusal == RefusalCode::kNone;
        if (is_open) ping();  // Or no setpoint is obeyed.
        break;
      case Pong::kId:
        if (pongs++ > 0) longest_pause_us = std::max(longest_pause_us, fake_time_us - heard_us);
        heard_us = fake_time_us;
        break;
      case Ack::kId:
        ++acks;
        break;
      default:
        break;
    }
  }

  uint16_t seq_ = 0;
  uint16_t request_id_ = 0;
  uint16_t ping_id_ = 0;  // Apart: a request far ahead of the newest one counts as an old one.
  uint32_t command_seq_ = 0;
  int64_t next_us_ = 0;
  int64_t next_ping_us_ = 0;
  FrameDecoder decoder_{body_size};
};

}  // namespace wheelwire::hil
