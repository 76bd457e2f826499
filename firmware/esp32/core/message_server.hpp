// What each message from the host does, and what the host is sent: answers, events, the state
// stream. See protocol/SPEC.md, "Sessions", "Setpoints", "Requests".
#pragma once

#include "configuration.hpp"
#include "link.hpp"
#include "protocol.hpp"
#include "recorder.hpp"
#include "robot.hpp"
#include "session.hpp"

namespace wheelwire {

/// What a device says of itself; the rest is of the Hello that it answers.
using Identity = DeviceHello;

class MessageServer;

/// What serves the messages of the group SENSOR; see `SensorServer`. Through an interface, so that
/// a device without peripherals does not carry it.
class SensorMessages {
 public:
  /// Called once, before the device serves a message.
  virtual void attach(MessageServer& server) = 0;
  /// Whether anything is read.
  virtual bool is_active() const = 0;
  /// Before the first `update`: the battery was at STOP before the reset.
  virtual void start_at_stop() = 0;
  /// Reads all. Returns what is forbidden until the next call, as flags of `reflex`, with
  /// kBatteryAtStop.
  virtual uint8_t update(uint64_t now_us) = 0;
  /// Carries out a request that is new in this session, and answers it.
  virtual void serve(const Frame& frame, uint16_t request_id, uint64_t now_us) = 0;
  /// Sends what is due.
  virtual void stream(uint64_t now_us) = 0;
  /// The states take so much of the line from now on.
  virtual void fit_to_line(uint32_t state_hz, uint64_t now_us) = 0;
  virtual void end_session() = 0;

  /// Which sensors hold the robot now, as flags of `held`.
  virtual uint32_t held() const = 0;

 protected:
  ~SensorMessages() = default;
};

/// Answers requests about the platform, of which this code knows nothing.
class PlatformMessages {
 public:
  /// Answers a request that is new in this session.
  virtual void serve(MessageServer& server, const Frame& frame, uint16_t request_id) = 0;

 protected:
  ~PlatformMessages() = default;
};

class MessageServer final : public RobotObserver {
 public:
  /// `robot` is not used before the first message: it may be constructed later. `configuration`:
  /// may be nullptr.
  MessageServer(Robot& robot, ByteStream& line, const Identity& identity,
                ActiveConfiguration* configuration)
      : robot_(robot), link_(line), identity_(identity), configuration_(configuration) {}

  /// From now on hosts may read what a recorder has stored.
  void offer(BoxArchive& archive) { archive_ = &archive; }
  /// From now on hosts may read sensors.
  void offer(SensorMessages& sensors) { sensors_ = &sensors; }
  /// From now on hosts may ask about the platform.
  void offer(PlatformMessages& platform) { platform_ = &platform; }
  /// Reads and answers what the host has sent.
  void service_link(uint64_t now_us);
  /// Carries out one message.
  void serve(const Frame& frame, uint64_t now_us);
  /// Sends the robot's state when it is due, and what holds it when that has changed. Call at the
  /// end of each control step.
  void stream_state(uint64_t now_us);
  /// Ends the session, and with it what its host commanded.
  void hang_up(uint64_t now_us);

  bool has_session() const { return session_.is_open(); }
  /// Whether the device is to restart: its host asked for it, or a configuration was not confirmed
  /// in time.
  bool is_restart_due(uint64_t now_us) const {
    return (restart_us_ != 0 && now_us >= restart_us_) ||
           (configuration_ != nullptr && configuration_->is_overdue(now_us));
  }

  void on_transition(Transition transition, uint64_t now_us) override {
    if (session_.is_open()) send_event(EventCode::kSupervisor, transition, now_us);
  }
  void on_trial_expired(uint64_t now_us) override {
    send_event(EventCode::kTrialExpired, {{}, robot_.state(), robot_.state()}, now_us);
  }
  void on_rolling(int32_t speed_umps, uint64_t now_us) override;
  uint32_t sensed() const override { return sensors_ == nullptr ? 0 : sensors_->held(); }

  // For SensorMessages and PlatformMessages.
  void conclude(uint8_t message_id, uint16_t request_id, RefusalCode refusal);
  /// The answer is not stored: a repeated request is carried out again. Storing the longest answers
  /// would take four times their size. `packed`: the struct whose fields are the message's last.
  template <typename Message, typename... Packed>
  RefusalCode answer_afresh(uint16_t request_id, Message message, const Packed&... packed) {
    message.session_id = session_.id();
    message.request_id = request_id;
    uint8_t body[Message::kSize];
    message.encode(body);
    (packed.encode(body + sizeof body - Packed::kSize), ...);
    session_.pass(request_id);
    link_.send_body(Message::kId, body, sizeof body);
    return kAnswered;
  }
  Link& link() { return link_; }
  uint32_t session_id() const { return session_.id(); }
  uint32_t boot_id() const { return identity_.boot_id; }
  ResetReason reset_reason() const { return identity_.reset_reason; }
  uint32_t state_interval_us() const { return state_interval_us_; }

 private:
  /// Between two looks at what holds the robot.
  static constexpr uint64_t kLookUs = 20'000;
  /// The request has got its answer.
  static constexpr RefusalCode kAnswered{UINT8_MAX};

  /// What was last reported in this session of what holds the robot.
  struct Reported {
    uint32_t held = 0;
    uint32_t contradictions = 0;
    uint8_t stop_news = 0;
    bool is_any = false;

    bool operator==(const Reported&) const = default;
  };

  void note_message(const Frame& frame, uint64_t now_us);
  void on(const Hello& hello, uint64_t now_us);
  void on(const Stop& stop, uint64_t now_us);
  void on(const Estop& estop, uint64_t now_us);
  void on(const SetWheelVelocity& message, uint64_t now_us);
  void on(const SetDuty& message, uint64_t now_us);
  void on(const Ping& ping, uint64_t now_us);

  template <typename... Requests>
  bool serve_once(const Frame& frame, uint64_t now_us);
  /// Hands a request to its `on` below, unless it is a repeat or of another session. That returns
  /// what to conclude with, or kAnswered.
  template <typename Request>
  void once(const Request& request, uint64_t now_us);
  RefusalCode on(const ClearEstop&, uint64_t now_us) { return robot_.clear_estop(now_us); }
  RefusalCode on(const ClearFault&, uint64_t now_us) { return robot_.clear_fault(now_us); }
  RefusalCode on(const SetStreamRate& request, uint64_t now_us);
  RefusalCode on(const ParameterGet& request, uint64_t now_us);
  RefusalCode on(const ParameterSet& request, uint64_t now_us);
  RefusalCode on(const ParameterSave& request, uint64_t) {
    return robot_.save_parameters(static_cast<ParameterId>(request.parameter));
  }
  RefusalCode on(const ParameterReset&, uint64_t now_us) { return robot_.reset_parameters(now_us); }
  RefusalCode on(const ParameterList& request, uint64_t now_us);
  RefusalCode on(const LinkCountersGet& request, uint64_t now_us);
  RefusalCode on(const ControlCountersGet& request, uint64_t now_us);
  RefusalCode on(const ParameterTrial& request, uint64_t now_us) {
    return robot_.try_parameters(request.action, request.timeout_s, now_us);
  }
  RefusalCode on(const GroupGet& request, uint64_t now_us);
  RefusalCode on(const Restart& request, uint64_t now_us);
  RefusalCode on(const ContradictionsGet& request, uint64_t now_us);
  RefusalCode on(const HoldGet& request, uint64_t now_us);
  RefusalCode on(const ConfigurationGet& request, uint64_t now_us);
  RefusalCode on(const PeripheralGet& request, uint64_t now_us);
  RefusalCode on(const BoardSet& request, uint64_t now_us);
  RefusalCode on(const PeripheralSet& request, uint64_t now_us);
  RefusalCode on(const ConfigurationWrite& request, uint64_t now_us);
  RefusalCode on(const ConfigurationConfirm& request, uint64_t now_us);
  RefusalCode on(const BoxGet& request, uint64_t now_us);
  RefusalCode on(const BoxRead& request, uint64_t now_us);
  RefusalCode on(const LedgerGet& request, uint64_t now_us);
  RefusalCode on(const UnsavedGet& request, uint64_t now_us);
  void serve_elsewhere(const Frame& frame, uint64_t now_us);

  template <typename Message>
  bool is_newest(const Message& message, uint64_t now_us);
  template <typename Message>
  void obey(const Message& message, ControlMode mode, WheelPair wheels, uint64_t now_us);
  template <typename Message>
  void refuse_setpoint(const Message& message, RefusalCode code, uint64_t now_us);
  bool is_new(uint8_t message_id, uint32_t session_id, uint16_t request_id);

  template <typename Request, typename Message>
  RefusalCode answer(const Request& request, Message message);
  template <typename Message>
  void keep_and_send(uint16_t request_id, const Message& message);
  template <typename Request>
  RefusalCode answer_value(const Request& request);
  void refuse(uint8_t message_id, uint32_t session_id, uint32_t reference, RefusalCode code);

  void set_stream_rate(uint32_t rate_hz, uint64_t now_us);
  void report_stores();
  void send_event(EventCode code, Transition transition, uint64_t t_us, float speed_mps = 0.0f);
  RefusalCode check_configuration_change(uint64_t now_us);
  /// Any other refusal came before the write: it excuses no late step.
  void note_configuration_write(RefusalCode refusal) {
    if (refusal == RefusalCode::kNone || refusal == RefusalCode::kStoreFailed)
      robot_.note_write(refusal == RefusalCode::kNone);
  }
  uint32_t configuration_held() const;
  uint32_t held(uint64_t now_us) const;
  Hold hold(uint64_t now_us) const;
  void report_hold(uint64_t now_us);
  void stream_wheels(uint64_t now_us);
  bool is_served(Group group) const;
  RefusalCode read_refusal() const;

  Robot& robot_;
  Link link_;
  Session session_;
  Identity identity_;
  ActiveConfiguration* configuration_;
  BoxArchive* archive_ = nullptr;
  uint64_t restart_us_ = 0;  // 0: no restart was asked for
  uint32_t refused_ = 0;
  uint32_t state_interval_us_ = 0;  // 0: not streaming
  uint64_t next_state_us_ = 0;
  uint64_t next_look_us_ = 0;  // For what holds the robot.
  uint64_t reported_us_ = 0;
  Reported reported_;
  SensorMessages* sensors_ = nullptr;
  PlatformMessages* platform_ = nullptr;
};

}  // namespace wheelwire
