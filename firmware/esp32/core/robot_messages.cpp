// What each message from the host does. See protocol/SPEC.md, "Sessions", "Setpoints", "Requests".
#include "robot.hpp"

namespace wheelwire {

void Robot::service_link(uint64_t now_us) {
  link_.new_turn();
  Frame frame;
  while (link_.receive(frame)) dispatch(frame, now_us);
}

void Robot::dispatch(const Frame& frame, uint64_t now_us) {
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
    case ClearEstop::kId:
      return on_request(ClearEstop::decode(frame.body), now_us);
    case ClearFault::kId:
      return on_request(ClearFault::decode(frame.body), now_us);
    case SetStreamRate::kId:
      return on_request(SetStreamRate::decode(frame.body), now_us);
    case ParameterGet::kId:
      return on_request(ParameterGet::decode(frame.body), now_us);
    case ParameterSet::kId:
      return on_request(ParameterSet::decode(frame.body), now_us);
    case ParameterSave::kId:
      return on_request(ParameterSave::decode(frame.body), now_us);
    case ParameterReset::kId:
      return on_request(ParameterReset::decode(frame.body), now_us);
    case ParameterList::kId:
      return on_request(ParameterList::decode(frame.body), now_us);
    case LinkCountersGet::kId:
      return on_request(LinkCountersGet::decode(frame.body), now_us);
    case ControlCountersGet::kId:
      return on_request(ControlCountersGet::decode(frame.body), now_us);
  }
}

// --- sessions ------------------------------------------------------------------------------------

void Robot::on(const Hello& hello, uint64_t now_us) {
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
    setpoint_ = {};
    apply(SupervisorEvent::kSession, now_us);
  }
  link_.send(DeviceHello{
      .nonce = hello.nonce,
      .protocol_version = schema::kVersion,
      .schema_hash = schema::kHash,
      .refusal = refusal,
      .boot_id = identity_.boot_id,
      .device_us = now_us,
      .reset_reason = identity_.reset_reason,
      .board = identity_.board,
      .board_id = identity_.board_id,
      .capabilities = identity_.capabilities,
      .version_major = identity_.version_major,
      .version_minor = identity_.version_minor,
      .version_patch = identity_.version_patch,
      .git_hash = identity_.git_hash,
  });
  if (!opens) return;
  const auto rate_hz = static_cast<uint32_t>(parameters_.get(ParameterId::kStreamRateHz));
  if (link_.carries(rate_hz, WheelState::kSize)) set_stream_rate(rate_hz, now_us);
  announce_store();
}

// --- stops: in any session and in none
// -------------------------------------------------------------

void Robot::on(const Stop& stop, uint64_t now_us) {
  if (session_.names(stop.session_id)) session_.take_command(stop.command_seq);
  const bool known_mode = stop.mode == StopMode::kCoast || stop.mode == StopMode::kBrake;
  apply(SupervisorEvent::kStop, now_us, known_mode ? stop.mode : StopMode::kConfigured);
  link_.send(Ack{stop.session_id, stop.request_id, Stop::kId});
}

void Robot::on(const Estop& estop, uint64_t now_us) {
  apply(SupervisorEvent::kEstop, now_us);
  link_.send(Ack{estop.session_id, estop.request_id, Estop::kId});
}

// --- setpoints
// -------------------------------------------------------------------------------------

void Robot::on(const SetWheelVelocity& message, uint64_t now_us) {
  if (!take(message)) return;
  if (!__builtin_isfinite(message.left_mps) || !__builtin_isfinite(message.right_mps))
    return refuse(message, message.command_seq, RefusalCode::kNotFinite);
  obey(message, ControlMode::kVelocity, {to_umps(message.left_mps), to_umps(message.right_mps)},
       now_us);
}

void Robot::on(const SetDuty& message, uint64_t now_us) {
  if (!take(message)) return;
  obey(message, ControlMode::kDuty, {message.left_duty_q15, message.right_duty_q15}, now_us);
}

/// True for a setpoint of this session that is newer than all before it. It is that also when it is
/// refused afterwards: no repeat of it, after a ClearEstop say, is looked at again.
template <typename Message>
bool Robot::take(const Message& message) {
  if (session_.names(message.session_id)) return session_.take_command(message.command_seq);
  refuse(message, message.command_seq, RefusalCode::kNoSession);
  return false;
}

template <typename Message>
void Robot::obey(const Message& message, ControlMode mode, WheelPair asked, uint64_t now_us) {
  const RefusalCode refusal = admit(message.expiry_us, now_us);
  if (refusal != RefusalCode::kNone) return refuse(message, message.command_seq, refusal);
  const uint64_t longest_us = now_us + config_.ttl_max_us;
  setpoint_ = {
      .mode = mode,
      .asked = asked,
      .target = limited(mode, asked),
      .deadline_us = message.expiry_us < longest_us ? message.expiry_us : longest_us,
      .command_seq = message.command_seq,
  };
  apply(SupervisorEvent::kSetpoint, now_us);
}

RefusalCode Robot::admit(uint64_t expiry_us, uint64_t now_us) const {
  if (!session_.clock_synchronised()) return RefusalCode::kClockUnsynchronised;
  if (expiry_us <= now_us) return RefusalCode::kExpired;
  return setpoint_refusal(supervisor_.state());
}

// --- the clock
// -------------------------------------------------------------------------------------

void Robot::on(const Ping& ping, uint64_t now_us) {
  if (!session_.names(ping.session_id))
    return refuse(ping, ping.request_id, RefusalCode::kNoSession);
  session_.note_ping();
  link_.send(Pong{session_.id(), ping.request_id, ping.host_us, now_us, now_us});
}

// --- requests, each carried out once
// ---------------------------------------------------------------

template <typename Request>
void Robot::on_request(const Request& request, uint64_t now_us) {
  if (!session_.names(request.session_id))
    return refuse(request, request.request_id, RefusalCode::kNoSession);
  const Answer* given = nullptr;
  switch (session_.classify(request.request_id, given)) {
    case Session::Request::kOld:
      return;
    case Session::Request::kRepeat:
      return link_.send_body(given->id, given->body, given->size);
    case Session::Request::kNew:
      break;
  }
  const RefusalCode refusal = carry_out(request, now_us);
  if (refusal == RefusalCode::kNone) {
    reply(request);
  } else {
    ++refused_;
    answer(request.request_id, Refuse{session_.id(), request.kId, refusal, request.request_id});
  }
}

RefusalCode Robot::carry_out(const ClearEstop&, uint64_t now_us) {
  if (config_.estop_input_enabled && hal_.estop.is_open()) return RefusalCode::kCausePresent;
  apply(SupervisorEvent::kClearEstop, now_us);
  trip(0, now_us);  // one that was latched below the e-stop
  return RefusalCode::kNone;
}

RefusalCode Robot::carry_out(const ClearFault&, uint64_t now_us) {
  if (lasting_faults() != 0) return RefusalCode::kCausePresent;
  faults_ = 0;
  apply(SupervisorEvent::kClearFault, now_us);
  return RefusalCode::kNone;
}

RefusalCode Robot::carry_out(const SetStreamRate& request, uint64_t now_us) {
  const auto control_rate_hz = static_cast<uint32_t>(parameters_.get(ParameterId::kControlRateHz));
  if (request.rate_hz > control_rate_hz || !link_.carries(request.rate_hz, WheelState::kSize))
    return RefusalCode::kRateTooHigh;
  set_stream_rate(request.rate_hz, now_us);
  return RefusalCode::kNone;
}

RefusalCode Robot::carry_out(const ParameterSave& request, uint64_t) {
  const auto id = static_cast<ParameterId>(request.parameter);
  const bool all = request.parameter == 0;
  if (!all && !Parameters::exists(id)) return RefusalCode::kUnknownParameter;
  const RefusalCode refusal = change_refusal(supervisor_.state(), ParameterChanges::kStopped);
  if (refusal != RefusalCode::kNone) return refusal;
  if (store_faults_ != 0) return RefusalCode::kStoreFailed;
  if (!(all ? parameters_.save(hal_.store) : parameters_.save_one(hal_.store, id)))
    return RefusalCode::kStoreFailed;
  store_state_ = Parameters::Load::kLoaded;
  return RefusalCode::kNone;
}

RefusalCode Robot::carry_out(const ParameterReset&, uint64_t now_us) {
  check_contact(now_us);
  const RefusalCode refusal = change_refusal(supervisor_.state(), ParameterChanges::kReleased);
  if (refusal != RefusalCode::kNone) return refusal;
  parameters_.set_defaults();
  apply_parameters();
  if (!hal_.store.erase()) return RefusalCode::kStoreFailed;
  store_state_ = Parameters::Load::kEmpty;
  store_faults_ = hal_.store.faults();
  return RefusalCode::kNone;
}

RefusalCode Robot::carry_out(const ParameterGet& request, uint64_t) {
  return Parameters::exists(static_cast<ParameterId>(request.parameter))
             ? RefusalCode::kNone
             : RefusalCode::kUnknownParameter;
}

RefusalCode Robot::carry_out(const ParameterSet& request, uint64_t now_us) {
  const auto id = static_cast<ParameterId>(request.parameter);
  RefusalCode refusal = parameters_.check(id, request.value);
  if (refusal != RefusalCode::kNone || request.value == parameters_.get(id)) return refusal;
  check_contact(now_us);  // it may have opened since the last control step
  refusal = change_refusal(supervisor_.state(), parameters_.spec(id).changes);
  if (refusal != RefusalCode::kNone) return refusal;
  parameters_.set(id, request.value);
  parameters_changed_ = true;
  if (!supervisor_.may_drive()) apply_parameters();
  return RefusalCode::kNone;
}

RefusalCode Robot::carry_out(const ParameterList& request, uint64_t) {
  return request.parameter_index < kParameterCount ? RefusalCode::kNone : RefusalCode::kOutOfRange;
}

RefusalCode Robot::carry_out(const LinkCountersGet&, uint64_t) { return RefusalCode::kNone; }
RefusalCode Robot::carry_out(const ControlCountersGet&, uint64_t) { return RefusalCode::kNone; }

// --- answers
// ---------------------------------------------------------------------------------------

template <typename Message>
void Robot::answer(uint16_t request_id, const Message& message) {
  Answer& record = session_.record(request_id);
  record.id = Message::kId;
  record.size = Message::kSize;
  message.encode(record.body);
  link_.send_body(record.id, record.body, record.size);
}

template <typename Request>
void Robot::reply(const Request& request) {
  answer(request.request_id, Ack{session_.id(), request.request_id, Request::kId});
}

void Robot::reply(const ParameterGet& request) {
  reply_value(request.request_id, request.parameter);
}

void Robot::reply(const ParameterSet& request) {
  reply_value(request.request_id, request.parameter);
}

void Robot::reply_value(uint16_t request_id, uint8_t parameter) {
  answer(request_id, ParameterValue{session_.id(), request_id, parameter,
                                    parameters_.get(static_cast<ParameterId>(parameter))});
}

void Robot::reply(const ParameterList& request) {
  const ParameterSpec& spec =
      parameters_.spec(static_cast<ParameterId>(request.parameter_index + 1));
  answer(request.request_id, ParameterEntry{
                                 .session_id = session_.id(),
                                 .request_id = request.request_id,
                                 .parameter_index = request.parameter_index,
                                 .parameter_count = kParameterCount,
                                 .parameter = static_cast<uint8_t>(spec.id),
                                 .value = parameters_.get(spec.id),
                                 .default_value = spec.default_value,
                                 .minimum = spec.minimum,
                                 .maximum = spec.maximum,
                             });
}

void Robot::reply(const LinkCountersGet& request) {
  const ReceiveCounters& received = link_.received();
  answer(request.request_id, LinkCounters{
                                 .session_id = session_.id(),
                                 .request_id = request.request_id,
                                 .frames_received = received.frames,
                                 .frames_sent = link_.frames_sent(),
                                 .bad_crc = received.bad_crc,
                                 .bad_cobs = received.bad_cobs,
                                 .unknown_id = received.unknown_id,
                                 .wrong_length = received.wrong_length,
                                 .seq_lost = received.seq_lost,
                                 .send_dropped = link_.send_dropped(),
                                 .refused = refused_,
                                 .faults_tripped = faults_tripped_,
                             });
}

void Robot::reply(const ControlCountersGet& request) {
  answer(request.request_id,
         ControlCounters{
             .session_id = session_.id(),
             .request_id = request.request_id,
             .late_steps = overruns_,
             .latest_step_us = latest_step_us_,
             .saturated_steps = drive_.left().saturated_steps() + drive_.right().saturated_steps(),
             .left_illegal = left_illegal_,
             .right_illegal = right_illegal_,
         });
}

template <typename Message>
void Robot::refuse(const Message& message, uint32_t reference, RefusalCode code) {
  ++refused_;
  link_.send(Refuse{message.session_id, Message::kId, code, reference});
}

}  // namespace wheelwire
