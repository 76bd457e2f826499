// The whole firmware behind two calls: service_link() when bytes have come, step() every control
// period. Both from one task.
#pragma once

#include "config.hpp"
#include "drive.hpp"
#include "hal.hpp"
#include "link.hpp"
#include "parameters.hpp"
#include "protocol.hpp"
#include "session.hpp"
#include "supervisor.hpp"

namespace wheelwire {

/// What the core drives and listens to. Owned by the caller, outlives the robot.
struct Hal {
  MotorPort& left_motor;
  MotorPort& right_motor;
  EncoderPort& encoders;
  ByteStream& line;
  ParameterStore& store;
  EstopInput& estop;
  BatterySense& battery;
};

/// Told to the host in DeviceHello.
struct Identity {
  uint32_t boot_id;
  ResetReason reset_reason;
  Board board;
  uint64_t board_id;
  uint32_t capabilities;
  uint8_t version_major;
  uint8_t version_minor;
  uint8_t version_patch;
  uint32_t git_hash;
};

class Robot {
 public:
  /// `specs`: see Parameters.
  Robot(const Hal& hal, const Identity& identity, const ParameterSpec* specs = kParameters);

  /// Loads the parameters and leaves BOOT. Call once the hardware is ready.
  void start(uint64_t now_us);
  /// One control step: encoders, link, supervision, outputs, state stream.
  void step(uint64_t now_us);
  /// Reads and answers what the host sent; for a line that must not wait for the next step.
  void service_link(uint64_t now_us);
  /// The host is gone, and the line tells: its session and what it commanded end with it. A serial
  /// line tells nothing; there the deadline acts.
  void hang_up(uint64_t now_us);
  /// A motor or encoder peripheral did not start: FAULT until the next reset.
  void report_driver_failure();

  uint32_t control_period_us() const { return config_.period_us; }
  float parameter(ParameterId id) const { return parameters_.get(id); }
  SupervisorState state() const { return supervisor_.state(); }
  uint32_t faults() const { return faults_; }
  bool has_session() const { return session_.is_open(); }
  /// When the setpoint obeyed expires, device clock.
  uint64_t deadline_us() const { return setpoint_.deadline_us; }

 private:
  struct Setpoint {
    ControlMode mode;
    WheelPair asked;
    WheelPair target;  ///< Within the limits.
    uint64_t deadline_us;
    uint32_t command_seq;
  };

  // robot.cpp: what happens every control step.
  uint32_t check_timing(uint64_t now_us);
  void trip(uint32_t faults, uint64_t now_us);
  void check_contact(uint64_t now_us);
  void check_deadline(uint64_t now_us);
  uint32_t lasting_faults() const;
  void actuate(uint64_t now_us);
  void stream_state(uint64_t now_us);
  void apply(SupervisorEvent event, uint64_t now_us, StopMode mode = StopMode::kConfigured);
  void apply_parameters();
  WheelPair limited(ControlMode mode, WheelPair asked) const;
  void set_stream_rate(uint32_t rate_hz, uint64_t now_us);
  void announce_store();

  // robot_messages.cpp: what each message does.
  void dispatch(const Frame& frame, uint64_t now_us);
  void on(const Hello& hello, uint64_t now_us);
  void on(const Stop& stop, uint64_t now_us);
  void on(const Estop& estop, uint64_t now_us);
  void on(const SetWheelVelocity& message, uint64_t now_us);
  void on(const SetDuty& message, uint64_t now_us);
  void on(const Ping& ping, uint64_t now_us);
  RefusalCode admit(uint64_t expiry_us, uint64_t now_us) const;
  template <typename Message>
  bool take(const Message& message);
  template <typename Message>
  void obey(const Message& message, ControlMode mode, WheelPair asked, uint64_t now_us);
  template <typename Request>
  void on_request(const Request& request, uint64_t now_us);

  // Carry a new request out: kNone, or why not.
  RefusalCode carry_out(const ClearEstop& request, uint64_t now_us);
  RefusalCode carry_out(const ClearFault& request, uint64_t now_us);
  RefusalCode carry_out(const SetStreamRate& request, uint64_t now_us);
  RefusalCode carry_out(const ParameterSave& request, uint64_t now_us);
  RefusalCode carry_out(const ParameterReset& request, uint64_t now_us);
  RefusalCode carry_out(const ParameterGet& request, uint64_t now_us);
  RefusalCode carry_out(const ParameterSet& request, uint64_t now_us);
  RefusalCode carry_out(const ParameterList& request, uint64_t now_us);
  RefusalCode carry_out(const LinkCountersGet& request, uint64_t now_us);
  RefusalCode carry_out(const ControlCountersGet& request, uint64_t now_us);

  // The answer to a request that was carried out.
  template <typename Request>
  void reply(const Request& request);
  void reply(const ParameterGet& request);
  void reply(const ParameterSet& request);
  void reply(const ParameterList& request);
  void reply(const LinkCountersGet& request);
  void reply(const ControlCountersGet& request);
  void reply_value(uint16_t request_id, uint8_t parameter);
  template <typename Message>
  void answer(uint16_t request_id, const Message& message);
  template <typename Message>
  void refuse(const Message& message, uint32_t reference, RefusalCode code);

  Hal hal_;
  Identity identity_;
  Parameters parameters_;
  ControlConfig config_;
  Link link_;
  Session session_;
  Supervisor supervisor_;
  Drive drive_;
  Setpoint setpoint_{};
  Parameters::Load store_state_ = Parameters::Load::kLoaded;
  bool parameters_changed_ = false;  // and not in force yet
  uint32_t store_faults_ = 0;
  uint32_t faults_ = 0;
  uint16_t faults_tripped_ = 0;
  bool driver_failed_ = false;
  uint64_t last_step_us_ = 0;
  uint64_t encoder_us_ = 0;
  uint32_t overruns_ = 0;
  uint32_t latest_step_us_ = 0;
  uint32_t left_illegal_ = 0;
  uint32_t right_illegal_ = 0;
  uint32_t refused_ = 0;
  uint64_t next_state_us_ = 0;
  uint32_t state_interval_us_ = 0;  // 0: not streaming
};

}  // namespace wheelwire
