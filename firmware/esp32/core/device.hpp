// The whole firmware: a robot and the server of its messages. Call step() every control period and
// service_link() when bytes have arrived, both from one task.
#pragma once

#include "message_server.hpp"
#include "robot.hpp"

namespace wheelwire {

class Device {
 public:
  /// `specs`: see Parameters. `configuration`: started.
  Device(const Hal& hal, const Identity& identity, const ParameterSpec* specs,
         ActiveConfiguration& configuration);
  /// Without a configuration.
  Device(const Hal& hal, const Identity& identity, const ParameterSpec* specs = kParameters,
         const BoardFacts& board = {})
      : server_(robot_, hal.line, identity, nullptr), robot_(hal, server_, specs, board) {}
  Device(const Device&) = delete;  // The two halves refer to each other.
  Device& operator=(const Device&) = delete;

  /// The board's peripherals, which hosts may read and replace. Call it before the start; it must
  /// outlive the device.
  void sense(SensorMessages& sensors);
  /// Loads the parameters and leaves BOOT. Call once the hardware is ready.
  void start(uint64_t now_us);
  /// From now on all is recorded. Call it after the start; the recorder must outlive the device.
  void record(Recorder& recorder) { robot_.record(recorder); }
  /// From now on hosts may read the archive's records; it must outlive the device.
  void offer(BoxArchive& archive) { server_.offer(archive); }
  /// From now on hosts may ask about what this runs on; it must outlive the device.
  void offer(PlatformMessages& platform) { server_.offer(platform); }
  /// One control step: encoders, link, supervision, outputs, state stream.
  void step(uint64_t now_us);
  /// Reads and answers what the host sent, without waiting for the next step.
  void service_link(uint64_t now_us);
  /// Call when the line reports that the host is gone, as a socket does: ends the session and stops
  /// the wheels. A UART reports no such thing; there the setpoint's deadline stops them.
  void hang_up(uint64_t now_us);
  /// A motor or encoder peripheral did not start: FAULT until the next reset.
  void report_driver_failure() { robot_.report_failure(fault::kDriverFailed); }

  // The parts of a control step, for a re-run, which has messages instead of a line.
  void note_reflexes(uint8_t reflexes) { robot_.note_reflexes(reflexes); }
  void begin_step(uint64_t now_us) { robot_.begin_step(now_us); }
  void serve(const Frame& frame, uint64_t now_us) { server_.serve(frame, now_us); }
  void finish_step(uint64_t now_us) { robot_.finish_step(now_us); }

  /// Whether the device is to restart. Its wheels stand still.
  bool is_restart_due(uint64_t now_us) const { return server_.is_restart_due(now_us); }

  /// Whether the wheels stand; see Robot.
  bool is_at_rest(uint64_t now_us) const { return robot_.is_at_rest(now_us); }
  /// Something was written to flash: the next control step may be late.
  void note_stall();

  uint32_t control_period_us() const { return robot_.control_period_us(); }
  bool on_trial() const { return robot_.on_trial(); }
  float parameter(ParameterId id) const { return robot_.parameters().get(id); }
  /// What the wheels are driven at in this step, um/s; 0 unless they follow a velocity.
  WheelPair commanded() const { return robot_.commanded(); }
  SupervisorState state() const { return robot_.state(); }
  uint32_t faults() const { return robot_.faults(); }
  uint64_t last_step_us() const { return robot_.last_step_us(); }
  bool has_session() const { return server_.has_session(); }
  /// What the sensors forbid, as flags of `reflex`.
  uint8_t reflexes() const { return robot_.reflexes(); }
  /// When the active setpoint expires, device clock; 0: there is none.
  uint64_t deadline_us() const { return robot_.deadline_us(); }

 private:
  Recorder* recorder() const { return robot_.recorder(); }
  void prepare_recorder();

  SensorMessages* sensors_ = nullptr;  // First, because each step uses it, as in Robot.
  MessageServer server_;
  Robot robot_;
};

}  // namespace wheelwire
