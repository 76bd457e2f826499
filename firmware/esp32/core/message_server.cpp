#include "message_server.hpp"

namespace wheelwire {

namespace {

/// Long enough for the acknowledgement to leave the chip.
constexpr uint64_t kRestartDelayUs = 50'000;

}  // namespace

void MessageServer::service_link(uint64_t now_us) {
  link_.renew_read_budget();
  Frame frame;
  while (link_.receive(frame)) serve(frame, now_us);
}

void MessageServer::hang_up(uint64_t now_us) {
  session_.close();
  state_interval_us_ = 0;
  if (sensors_ != nullptr) sensors_->end_session();
  robot_.end_session(SupervisorEvent::kStop, StopCause::kHangUp, now_us);
}

void MessageServer::note_message(const Frame& frame, uint64_t now_us) {
  Recorder& recorder = *robot_.recorder();
  if (recorder.wants_state()) recorder.note_state(*this, robot_);
  recorder.note_message(frame.id, frame.body, static_cast<size_t>(body_size(frame.id)), now_us);
}

/// Hands a frame to its request; false: it is not one of these requests.
template <typename... Requests>
bool MessageServer::serve_once(const Frame& frame, uint64_t now_us) {
  return ((frame.id == Requests::kId && (once(Requests::decode(frame.body), now_us), true)) || ...);
}

void MessageServer::serve(const Frame& frame, uint64_t now_us) {
  if (robot_.recorder() != nullptr) note_message(frame, now_us);
  // The ids of these have no gaps: a table finds the message.
  switch (frame.id) {
    case Hello::kId:
      return on(Hello::decode(frame.body), now_us);
    case Stop::kId:
      return on(Stop::decode(frame.body), now_us);
    case Estop::kId:
      return on(Estop::decode(frame.body), now_us);
    case SetWheelVelocity::kId:
      return on(SetWheelVelocity::decode(frame.body), now_us);
    case SetDuty::kId:
      return on(SetDuty::decode(frame.body), now_us);
    case Ping::kId:
      return on(Ping::decode(frame.body), now_us);
    default:
      if (serve_once<ClearEstop, ClearFault, SetStreamRate, ParameterGet, ParameterSet,
                     ParameterSave, ParameterReset, ParameterList, LinkCountersGet,
                     ControlCountersGet, ParameterTrial, GroupGet, Restart, ContradictionsGet,
                     HoldGet, ConfigurationGet, PeripheralGet, BoardSet, PeripheralSet,
                     ConfigurationWrite, ConfigurationConfirm, BoxGet, BoxRead, LedgerGet,
                     UnsavedGet>(frame, now_us))
        return;
      serve_elsewhere(frame, now_us);
  }
}

// --- sessions ------------------------------------------------------------------------------------

void MessageServer::on(const Hello& hello, uint64_t now_us) {
  RefusalCode refusal = RefusalCode::kNone;
  if (hello.protocol_version != schema::kVersion) {
    refusal = RefusalCode::kProtocolVersion;
  } else if (hello.schema_hash != schema::kHash) {
    refusal = RefusalCode::kSchema;
  }
  const bool opens = refusal == RefusalCode::kNone && !session_.is_open_with(hello.nonce);
  if (opens) {
    session_.open(hello.nonce, identity_.boot_id);
    link_.restart_sequence();
    if (configuration_ != nullptr) configuration_->drop_candidate();
    if (sensors_ != nullptr) sensors_->end_session();
    robot_.end_session(SupervisorEvent::kSession, StopCause::kNewSession, now_us);
    robot_.begin_session(session_.id());
    reported_ = {};
    next_look_us_ = now_us;
  }
  DeviceHello answer = identity_;
  answer.nonce = hello.nonce;
  answer.protocol_version = schema::kVersion;
  answer.schema_hash = schema::kHash;
  answer.refusal = refusal;
  answer.device_us = now_us;
  link_.send(answer);
  if (!opens) return;
  const auto rate_hz = static_cast<uint32_t>(robot_.parameters().get(ParameterId::kStreamRateHz));
  if (link_.carries(rate_hz, WheelState::kSize)) set_stream_rate(rate_hz, now_us);
  report_stores();
}

/// A host learns once, when its session opens, if no parameters are saved, and which blocks had
/// only one copy at the start. Unreadable blocks are not reported here: they are a fault or an
/// e-stop.
void MessageServer::report_stores() {
  constexpr EventCode kLost[kStoredBlocks] = {EventCode::kConfigurationCopyLost,
                                              EventCode::kParametersCopyLost,
                                              EventCode::kLatchesCopyLost};
  const Transition none{{}, robot_.state(), robot_.state()};
  if (robot_.store_state() == Parameters::Load::kEmpty)
    send_event(EventCode::kStoreEmpty, none, robot_.last_step_us());
  for (size_t i = 0; i < kStoredBlocks; ++i)
    if ((robot_.lost_copies() >> i & 1) != 0) send_event(kLost[i], none, robot_.last_step_us());
}

// --- stops, with or without a session ------------------------------------------------------------

void MessageServer::on(const Stop& stop, uint64_t now_us) {
  const bool by_session = session_.matches(stop.session_id);
  if (by_session) session_.take_command(stop.command_seq);
  const bool known_mode = stop.mode <= StopMode::kBrakeUntilDriven;
  robot_.stop(known_mode ? stop.mode : StopMode::kConfigured, by_session, now_us);
  link_.send(Ack{stop.session_id, stop.request_id, Stop::kId});
}

void MessageServer::on(const Estop& estop, uint64_t now_us) {
  robot_.estop(
      session_.matches(estop.session_id) ? EstopSource::kSession : EstopSource::kOtherProgram,
      now_us);
  link_.send(Ack{estop.session_id, estop.request_id, Estop::kId});
}

// --- setpoints -----------------------------------------------------------------------------------

void MessageServer::on(const SetWheelVelocity& message, uint64_t now_us) {
  if (!is_newest(message, now_us)) return;
  if (!__builtin_isfinite(message.left_mps) || !__builtin_isfinite(message.right_mps))
    return refuse_setpoint(message, RefusalCode::kNotFinite, now_us);
  obey(message, ControlMode::kVelocity, {to_umps(message.left_mps), to_umps(message.right_mps)},
       now_us);
}

void MessageServer::on(const SetDuty& message, uint64_t now_us) {
  if (!is_newest(message, now_us)) return;
  obey(message, ControlMode::kDuty, {message.left_duty_q15, message.right_duty_q15}, now_us);
}

/// True for a setpoint of this session that is newer than all before it. Its number is used up even
/// if it is refused afterwards: a repeat of it that comes after a ClearEstop, say, must not drive.
template <typename Message>
bool MessageServer::is_newest(const Message& message, uint64_t now_us) {
  if (!session_.matches(message.session_id)) {
    refuse_setpoint(message, RefusalCode::kNoSession, now_us);
    return false;
  }
  if (session_.take_command(message.command_seq)) return true;
  if (session_.is_spent(message.command_seq))
    refuse_setpoint(message, RefusalCode::kCommandSeqSpent, now_us);
  return false;
}

template <typename Message>
void MessageServer::obey(const Message& message, ControlMode mode, WheelPair wheels,
                         uint64_t now_us) {
  RefusalCode refusal = configuration_ != nullptr ? configuration_->refusal() : RefusalCode::kNone;
  if (refusal != RefusalCode::kNone) {
    // What is wired to the pins is unknown.
  } else if (restart_us_ != 0) {
    refusal = RefusalCode::kBooting;
  } else if (!session_.clock_synchronised()) {
    refusal = RefusalCode::kClockUnsynchronised;
  } else {
    refusal = robot_.obey({mode, wheels, message.expiry_us, message.command_seq}, now_us);
  }
  if (refusal != RefusalCode::kNone) refuse_setpoint(message, refusal, now_us);
}

template <typename Message>
void MessageServer::refuse_setpoint(const Message& message, RefusalCode code, uint64_t now_us) {
  robot_.note_refused_setpoint(now_us);
  refuse(message.kId, message.session_id, message.command_seq, code);
}

// --- the clock -----------------------------------------------------------------------------------

void MessageServer::on(const Ping& ping, uint64_t now_us) {
  if (!session_.matches(ping.session_id))
    return refuse(ping.kId, ping.session_id, ping.request_id, RefusalCode::kNoSession);
  session_.note_ping();
  link_.send(Pong{session_.id(), ping.request_id, ping.host_us, now_us, now_us});
}

// --- requests, each carried out once -------------------------------------------------------------

template <typename Request>
void MessageServer::once(const Request& request, uint64_t now_us) {
  if (!is_new(Request::kId, request.session_id, request.request_id)) return;
  const RefusalCode refusal =
      is_served(group_of(Request::kId)) ? on(request, now_us) : RefusalCode::kNotSupported;
  if (refusal != kAnswered) conclude(Request::kId, request.request_id, refusal);
}

/// True for a request that this session has not seen. A repeat is given its answer again.
bool MessageServer::is_new(uint8_t message_id, uint32_t session_id, uint16_t request_id) {
  if (!session_.matches(session_id)) {
    refuse(message_id, session_id, request_id, RefusalCode::kNoSession);
    return false;
  }
  const Answer* given = nullptr;
  const Session::Request kind = session_.classify(request_id, given);
  if (kind == Session::Request::kRepeat) link_.send_body(given->id, given->body, given->size);
  return kind == Session::Request::kNew;
}

RefusalCode MessageServer::on(const SetStreamRate& request, uint64_t now_us) {
  const auto control_rate_hz =
      static_cast<uint32_t>(robot_.parameters().get(ParameterId::kControlRateHz));
  if (request.rate_hz > control_rate_hz || !link_.carries(request.rate_hz, WheelState::kSize))
    return RefusalCode::kRateTooHigh;
  set_stream_rate(request.rate_hz, now_us);
  return RefusalCode::kNone;
}

RefusalCode MessageServer::on(const ParameterGet& request, uint64_t) {
  if (!Parameters::exists(static_cast<ParameterId>(request.parameter)))
    return RefusalCode::kUnknownParameter;
  return answer_value(request);
}

RefusalCode MessageServer::on(const ParameterSet& request, uint64_t now_us) {
  const RefusalCode refusal =
      robot_.set_parameter(static_cast<ParameterId>(request.parameter), request.value, now_us);
  return refusal == RefusalCode::kNone ? answer_value(request) : refusal;
}

RefusalCode MessageServer::on(const ParameterList& request, uint64_t) {
  if (request.parameter_index >= kParameterCount) return RefusalCode::kOutOfRange;
  const Parameters& parameters = robot_.parameters();
  const ParameterSpec& spec =
      parameters.spec(static_cast<ParameterId>(request.parameter_index + 1));
  return answer(request, ParameterEntry{
                             .parameter_index = request.parameter_index,
                             .parameter_count = kParameterCount,
                             .parameter = static_cast<uint8_t>(spec.id),
                             .value = parameters.get(spec.id),
                             .default_value = spec.default_value,
                             .minimum = spec.minimum,
                             .maximum = spec.maximum,
                         });
}

RefusalCode MessageServer::on(const LinkCountersGet& request, uint64_t) {
  const ReceiveCounters& received = link_.received();
  return answer(request, LinkCounters{
                             .frames_received = received.frames,
                             .frames_sent = link_.frames_sent(),
                             .bad_crc = received.bad_crc,
                             .bad_cobs = received.bad_cobs,
                             .unknown_id = received.unknown_id,
                             .wrong_length = received.wrong_length,
                             .seq_lost = received.seq_lost,
                             .send_dropped = link_.send_dropped(),
                             .refused = refused_,
                             .faults_tripped = robot_.faults_tripped(),
                         });
}

RefusalCode MessageServer::on(const ControlCountersGet& request, uint64_t) {
  const EncoderCounts& counts = robot_.encoder_counts();
  return answer(request, ControlCounters{
                             .late_steps = robot_.late_steps(),
                             .latest_step_us = robot_.longest_interval_us(),
                             .saturated_steps =
                                 robot_.left().saturated_steps() + robot_.right().saturated_steps(),
                             .left_illegal = counts.left_illegal,
                             .right_illegal = counts.right_illegal,
                         });
}

RefusalCode MessageServer::on(const ContradictionsGet& request, uint64_t) {
  return answer(request, Contradictions{.active = robot_.active_contradictions(),
                                        .refused = robot_.refused_contradictions()});
}

RefusalCode MessageServer::on(const HoldGet& request, uint64_t now_us) {
  return answer_afresh(request.request_id, hold(now_us));
}

// --- answers -------------------------------------------------------------------------------------

/// Answers a request, and keeps the answer for a repeat of it.
template <typename Request, typename Message>
RefusalCode MessageServer::answer(const Request& request, Message message) {
  message.session_id = session_.id();
  message.request_id = request.request_id;
  keep_and_send(request.request_id, message);
  return kAnswered;
}

template <typename Message>
void MessageServer::keep_and_send(uint16_t request_id, const Message& message) {
  static_assert(Message::kSize <= kMaxAnswer);
  Answer& record = session_.record(request_id);
  record.id = Message::kId;
  record.size = Message::kSize;
  message.encode(record.body);
  link_.send_body(record.id, record.body, record.size);
}

template <typename Request>
RefusalCode MessageServer::answer_value(const Request& request) {
  const auto id = static_cast<ParameterId>(request.parameter);
  return answer(request, ParameterValue{.parameter = request.parameter,
                                        .value = robot_.parameters().get(id)});
}

void MessageServer::conclude(uint8_t message_id, uint16_t request_id, RefusalCode refusal) {
  if (refusal == RefusalCode::kNone)
    return keep_and_send(request_id, Ack{session_.id(), request_id, message_id});
  ++refused_;
  if (robot_.recorder() != nullptr) robot_.recorder()->note_refusal(message_id, refusal);
  keep_and_send(request_id, Refuse{session_.id(), message_id, refusal, request_id});
}

void MessageServer::refuse(uint8_t message_id, uint32_t session_id, uint32_t reference,
                           RefusalCode code) {
  ++refused_;
  if (robot_.recorder() != nullptr) robot_.recorder()->note_refusal(message_id, code);
  link_.send(Refuse{session_id, message_id, code, reference});
}

// --- groups, restart -----------------------------------------------------------------------------

bool MessageServer::is_served(Group group) const {
  switch (group) {
    case Group::kBase:
      return true;
    case Group::kConfiguration:
      return configuration_ != nullptr;
    case Group::kRecorder:
      return archive_ != nullptr;
    case Group::kStore:
      return true;
    case Group::kSensor:
      return sensors_ != nullptr;
    case Group::kPlatform:
      return platform_ != nullptr;
  }
  return false;
}

RefusalCode MessageServer::on(const GroupGet& request, uint64_t) {
  return answer(request, GroupInfo{.group = request.group,
                                   .hash = is_served(request.group) ? hash_of(request.group) : 0});
}

RefusalCode MessageServer::on(const Restart&, uint64_t now_us) {
  if (!(identity_.capabilities & capability::kRestart)) return RefusalCode::kNotSupported;
  RefusalCode refusal = robot_.check_stopped();
  if (refusal == RefusalCode::kNone && configuration_ != nullptr &&
      configuration_->has_candidate()) {
    refusal = robot_.check_estop(now_us);
    if (refusal == RefusalCode::kNone) {
      refusal = configuration_->request_trial();
      note_configuration_write(refusal);
    }
  }
  if (refusal == RefusalCode::kNone) restart_us_ = now_us + kRestartDelayUs;
  return refusal;
}

// --- the configuration ---------------------------------------------------------------------------

RefusalCode MessageServer::on(const ConfigurationGet& request, uint64_t) {
  return answer_afresh(request.request_id,
                       ConfigurationValue{.state = configuration_->state(),
                                          .peripheral_count = configuration_->peripherals().count,
                                          .fingerprint = configuration_->fingerprint()},
                       configuration_->board());
}

RefusalCode MessageServer::on(const PeripheralGet& request, uint64_t) {
  const PeripheralList& list = configuration_->peripherals();
  return answer_afresh(request.request_id, PeripheralValue{.channel = request.channel},
                       request.channel < list.count ? list.entries[request.channel] : Peripheral{});
}

RefusalCode MessageServer::on(const BoardSet& request, uint64_t) {
  uint8_t body[BoardSet::kSize];
  request.encode(body);
  return configuration_->stage_board(body + sizeof body - BoardDescription::kSize);
}

RefusalCode MessageServer::on(const PeripheralSet& request, uint64_t) {
  uint8_t body[PeripheralSet::kSize];
  request.encode(body);
  return configuration_->stage_peripheral(request.channel, body + sizeof body - Peripheral::kSize);
}

/// Why the configuration cannot change now. Else one without the contact that is open would be a
/// way around it.
RefusalCode MessageServer::check_configuration_change(uint64_t now_us) {
  if (configuration_->is_fixed()) return RefusalCode::kNotSupported;
  const RefusalCode refusal = robot_.check_stopped();
  return refusal == RefusalCode::kNone ? robot_.check_estop(now_us) : refusal;
}

RefusalCode MessageServer::on(const ConfigurationWrite& request, uint64_t now_us) {
  RefusalCode refusal = check_configuration_change(now_us);
  if (refusal != RefusalCode::kNone) return refusal;
  refusal = configuration_->write(request.peripheral_count, request.fingerprint);
  note_configuration_write(refusal);
  return refusal;
}

RefusalCode MessageServer::on(const ConfigurationConfirm& request, uint64_t now_us) {
  RefusalCode refusal = check_configuration_change(now_us);
  if (refusal != RefusalCode::kNone) return refusal;
  refusal = configuration_->confirm(request.fingerprint);
  note_configuration_write(refusal);
  if (refusal != RefusalCode::kNone) return refusal;
  robot_.note_board_confirmed();
  // A board's pins are only set up when the device starts, so restart.
  if (!configuration_->is_confirmed()) restart_us_ = now_us + kRestartDelayUs;
  return refusal;
}

// --- the recorder --------------------------------------------------------------------------------

/// Why what is recorded cannot be read now. An emergency stop or a fault that is latched is no
/// reason: just then it is wanted.
RefusalCode MessageServer::read_refusal() const {
  const bool drives = robot_.state() == SupervisorState::kDriving;
  return drives ? RefusalCode::kNotStopped : RefusalCode::kNone;
}

RefusalCode MessageServer::on(const BoxGet& request, uint64_t) {
  if (read_refusal() != RefusalCode::kNone) return read_refusal();
  BoxValue value{.age = request.age};
  archive_->describe(value);
  return answer_afresh(request.request_id, value);
}

RefusalCode MessageServer::on(const BoxRead& request, uint64_t) {
  if (read_refusal() != RefusalCode::kNone) return read_refusal();
  BoxPart part{.number = request.number, .offset = request.offset};
  auto* const data = reinterpret_cast<uint8_t*>(part.data);
  part.size =
      static_cast<uint8_t>(archive_->read(request.number, request.offset, data, sizeof part.data));
  return answer_afresh(request.request_id, part);
}

RefusalCode MessageServer::on(const LedgerGet& request, uint64_t now_us) {
  if (read_refusal() != RefusalCode::kNone) return read_refusal();
  LedgerValue value;
  archive_->count(value, now_us);
  return answer_afresh(request.request_id, value);
}

// --- the store -----------------------------------------------------------------------------------

RefusalCode MessageServer::on(const UnsavedGet& request, uint64_t) {
  // Reading flash takes time that a control step does not have.
  if (robot_.state() == SupervisorState::kDriving) return RefusalCode::kNotStopped;
  return answer(request, UnsavedValue{.parameters = robot_.unsaved_parameters()});
}

// --- sensors, platform ---------------------------------------------------------------------------

/// What other objects answer. Each of these requests begins as any request does.
void MessageServer::serve_elsewhere(const Frame& frame, uint64_t now_us) {
  const Group group = group_of(frame.id);
  const bool from_host = frame.id < kFirstDeviceId;
  if (!from_host || (group != Group::kSensor && group != Group::kPlatform)) return;
  const uint8_t* at = frame.body;
  const auto session_id = wire::take<uint32_t>(at);
  const auto request_id = wire::take<uint16_t>(at);
  if (!is_new(frame.id, session_id, request_id)) return;
  if (!is_served(group)) return conclude(frame.id, request_id, RefusalCode::kNotSupported);
  if (group == Group::kSensor) return sensors_->serve(frame, request_id, now_us);
  platform_->serve(*this, frame, request_id);
}

// --- what is sent unasked ------------------------------------------------------------------------

void MessageServer::on_rolling(int32_t speed_umps, uint64_t now_us) {
  if (!session_.is_open()) return;
  send_event(EventCode::kRolling, {{}, robot_.state(), robot_.state()}, now_us, to_mps(speed_umps));
}

void MessageServer::send_event(EventCode code, Transition transition, uint64_t t_us,
                               float speed_mps) {
  link_.send(Event{
      .boot_id = identity_.boot_id,
      .t_us = static_cast<uint32_t>(t_us),
      .code = code,
      .cause = transition.cause,
      .before = transition.before,
      .after = transition.after,
      .faults = static_cast<uint16_t>(robot_.faults()),
      .speed_mps = speed_mps,
  });
}

void MessageServer::set_stream_rate(uint32_t rate_hz, uint64_t now_us) {
  state_interval_us_ = rate_hz == 0 ? 0 : 1'000'000 / rate_hz;
  next_state_us_ = now_us;
  if (sensors_ != nullptr) sensors_->fit_to_line(rate_hz, now_us);
}

void MessageServer::stream_state(uint64_t now_us) {
  const bool is_due = state_interval_us_ != 0 && now_us >= next_state_us_;
  // A step does not send both, unless each step sends a state.
  if (now_us >= next_look_us_ + (is_due ? kLookUs : 0)) report_hold(now_us);
  if (is_due) stream_wheels(now_us);
}

void MessageServer::stream_wheels(uint64_t now_us) {
  next_state_us_ += state_interval_us_;
  // After a gap the states that were missed are not sent in a burst.
  if (next_state_us_ <= now_us) next_state_us_ = now_us + state_interval_us_;
  const Wheel& left = robot_.left();
  const Wheel& right = robot_.right();
  link_.send(WheelState{
      .boot_id = identity_.boot_id,
      .t_us = static_cast<uint32_t>(robot_.encoder_counts().t_us),
      .left_ticks = left.ticks(),
      .right_ticks = right.ticks(),
      .left_mps = to_mps(left.velocity_umps()),
      .right_mps = to_mps(right.velocity_umps()),
      .left_duty_q15 = static_cast<int16_t>(left.duty_q15()),
      .right_duty_q15 = static_cast<int16_t>(right.duty_q15()),
      .command_seq = robot_.command_seq(),
      .supervisor = robot_.state(),
      .faults = static_cast<uint16_t>(robot_.faults()),
      .overruns = static_cast<uint16_t>(robot_.late_steps()),
      .battery_mv = robot_.battery_mv(),
  });
}

}  // namespace wheelwire
