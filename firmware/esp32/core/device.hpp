// The whole firmware: a robot and the server of its messages. Call step() every control period and
// service_link() when bytes have arrived, both from one task.
#pragma once

#include "message_server.hpp"
#include "robot.hpp"

namespace wheelwire {

class Device {
 public:
  /// `specs`: see Parameters. `keeper`: started.
  Device(const Hal& hal, const Identity& identity, const ParameterSpec* specs, BoardKeeper* keeper)
      : server_(robot_, hal.line, identity, keeper), robot_(hal, server_, specs, facts_of(keeper)) {
    if (keeper != nullptr && keeper->state() == BoardState::kNone)
      robot_.report_failure(fault::kNoBoard);
  }
  /// Where no board can be written.
  Device(const Hal& hal, const Identity& identity, const ParameterSpec* specs = kParameters,
         const BoardFacts& board = {})
      : server_(robot_, hal.line, identity, nullptr), robot_(hal, server_, specs, board) {}
  Device(const Device&) = delete;  // The two halves refer to each other.
  Device& operator=(const Device&) = delete;

  /// Loads the parameters and leaves BOOT. Call once the hardware is ready.
  void start(uint64_t now_us) { robot_.start(now_us); }
  /// One control step: encoders, link, supervision, outputs, state stream.
  void step(uint64_t now_us);
  /// Reads and answers what the host sent, without waiting for the next step.
  void service_link(uint64_t now_us) { server_.service_link(now_us); }
  /// Call when the line reports that the host is gone, as a socket does: ends the session and stops
  /// the wheels. A UART reports no such thing; there the setpoint's deadline stops them.
  void hang_up(uint64_t now_us) { server_.hang_up(now_us); }
  /// A motor or encoder peripheral did not start: FAULT until the next reset.
  void report_driver_failure() { robot_.report_failure(fault::kDriverFailed); }

  /// Whether the device is to restart. Its wheels stand still.
  bool is_restart_due(uint64_t now_us) const { return server_.is_restart_due(now_us); }

  uint32_t control_period_us() const { return robot_.control_period_us(); }
  bool on_trial() const { return robot_.on_trial(); }
  float parameter(ParameterId id) const { return robot_.parameters().get(id); }
  /// What the wheels are driven at in this step, um/s; 0 unless they follow a velocity.
  WheelPair commanded() const { return robot_.commanded(); }
  SupervisorState state() const { return robot_.state(); }
  uint32_t faults() const { return robot_.faults(); }
  bool has_session() const { return server_.has_session(); }
  /// When the active setpoint expires, device clock; 0: there is none.
  uint64_t deadline_us() const { return robot_.deadline_us(); }

 private:
  static BoardFacts facts_of(const BoardKeeper* keeper);

  MessageServer server_;
  Robot robot_;
};

}  // namespace wheelwire
