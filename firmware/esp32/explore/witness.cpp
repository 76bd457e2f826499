#include "witness.hpp"

#include <cmath>
#include <cstring>
#include <numbers>

#include "boards.hpp"
#include "names.hpp"
#include "peripheral_lists.hpp"

namespace wheelwire::explore {

namespace {

using enum RefusalCode;

constexpr size_t kKeptAnswers = 4;
constexpr double kDoubt = 1e-5;
/// Room for what a message may be answered with, and the events that it causes.
constexpr size_t kLongestFrames = 3 * 90;
constexpr uint32_t kLineShare[] = {4, 5};
constexpr uint32_t kStoreFaults =
    fault::kStoreFull | fault::kStoreNewer | fault::kStoreUnreadable | fault::kStoreOutdated;
constexpr StoredBlock kBlocks[] = {StoredBlock::kConfiguration, StoredBlock::kParameterValues,
                                   StoredBlock::kLatches};

/// The message's fields that every request begins with.
struct Head {
  uint32_t session_id;
  uint16_t request_id;
};

/// The code, if that is so.
Codes when(bool refused, RefusalCode code) { return refused ? Codes(code) : Codes(); }

/// Empty: there is none.
Codes first_of(std::initializer_list<Codes> reasons) {
  for (const Codes codes : reasons)
    if (!codes.empty()) return codes;
  return {};
}

Head head_of(const Seen& message) {
  Head head{};
  const uint8_t* in = message.body.data();
  wire::get(in, head.session_id);
  wire::get(in, head.request_id);
  return head;
}

/// Whether a repeat of the request is carried out again.
bool is_answered_afresh(uint8_t id) {
  return id == ConfigurationGet::kId || id == BoxGet::kId || id == BoxRead::kId ||
         id == LedgerGet::kId || id == PeripheralGet::kId || id == HoldGet::kId;
}

/// Messages that are sent without further requests once a host has asked for them.
bool is_of_sensors(uint8_t id) {
  return id == SensorInfo::kId || id == Imu::kId || id == Power::kId || id == Inputs::kId ||
         id == SensorEvent::kId;
}

/// Boards are written as shipped, or broken; boards for other chips are refused.
bool can_be_used(const Configuration& configuration) {
  const auto is_same = [&](const BoardDescription& board) {
    return board.chip == kBoardOfEsp32.chip && board == configuration.board;
  };
  const auto& boards = shipped_boards();
  return (is_same(sim::kOwnBoard) || std::any_of(boards.begin(), boards.end(), is_same)) &&
         (!has_levels(configuration.peripherals) || configuration.board.battery >= 0);
}

PackedConfiguration packed(const Configuration& configuration) {
  PackedConfiguration bytes;
  configuration.encode(bytes.data());
  return bytes;
}

Configuration unpacked(const PackedConfiguration& bytes) {
  Configuration configuration;
  Configuration::decode(bytes.data(), bytes.size(), configuration);
  return configuration;
}

}  // namespace

std::string Codes::text() const {
  std::string text;
  for (unsigned code = 0; code < 32; ++code)
    if ((bits_ >> code & 1) != 0)
      text += (text.empty() ? "" : " or ") + name_of(static_cast<RefusalCode>(code));
  return text;
}

// --- what the firmware reads ---------------------------------------------------------------------

void Witness::reads(const Seen& message) {
  task_ = Task{.message = message, .before = simulator_.state(), .codes = {}, .exact = {}};
  wanted_.reset();
  switch (message.id) {
    case Hello::kId:
      return read_hello(message.as<Hello>());
    case Stop::kId:
    case Estop::kId:
      task_->answers = task_->is_new = true;
      task_->codes = kNone;
      return;
    case SetWheelVelocity::kId: {
      const auto setpoint = message.as<SetWheelVelocity>();
      return read_setpoint(setpoint, false, static_cast<double>(setpoint.left_mps),
                           static_cast<double>(setpoint.right_mps));
    }
    case SetDuty::kId: {
      const auto setpoint = message.as<SetDuty>();
      return read_setpoint(setpoint, true, setpoint.left_duty_q15 / 32767.0,
                           setpoint.right_duty_q15 / 32767.0);
    }
    case Ping::kId:
      task_->answers = task_->is_new = true;
      task_->codes = open_ && message.as<Ping>().session_id == session_id_ ? kNone : kNoSession;
      return;
    default:
      if (message.id >= kFirstDeviceId) {
        task_.reset();
        return;
      }
      return read_request(head_of(message).session_id, head_of(message).request_id);
  }
}

void Witness::read_hello(const Hello& hello) {
  task_->answers = true;
  task_->codes = hello.protocol_version != schema::kVersion ? kProtocolVersion
                 : hello.schema_hash != schema::kHash       ? kSchema
                                                            : kNone;
  task_->is_new = task_->codes.has(kNone) && !(open_ && hello.nonce == nonce_);
}

template <typename Setpoint>
void Witness::read_setpoint(const Setpoint& message, bool duty, double left, double right) {
  const auto refuse = [this](RefusalCode code) {
    task_->answers = true;
    denied_ = task_->codes = code;
    setpoint_us_ = now_us();
  };
  if (!open_ || message.session_id != session_id_) return refuse(kNoSession);
  if (message.command_seq <= newest_command_) {
    // Dropped without an answer, but where no number is left.
    const bool is_spent = newest_command_ == UINT32_MAX && message.command_seq != UINT32_MAX;
    if (is_spent) refuse(kCommandSeqSpent);
    return;
  }
  newest_command_ = message.command_seq;
  task_->is_new = true;
  // In the device's own resolution: a setpoint below it is zero.
  const auto way_of = [duty](double value) -> uint32_t {
    if (std::abs(value) < (duty ? 1e-9 : 0.5e-6)) return 0;
    return value > 0.0 ? reflex::kNoForward : reflex::kNoReverse;
  };
  const auto ways = static_cast<uint8_t>(way_of(left) | way_of(right));
  task_->is_zero = ways == 0;
  const bool may_arm = may_be_gap();
  if (!std::isfinite(left) || !std::isfinite(right)) {
    task_->codes = kNotFinite;
    setpoint_us_ = now_us();
  } else {
    task_->codes = setpoint_codes(message.expiry_us, ways == 0, ways);
  }
  task_->answers = !task_->codes.has(kNone);
  if (task_->answers) denied_ = task_->codes;
  const auto ttl_us =
      static_cast<uint64_t>(std::ceil(static_cast<double>(value(ParameterId::kTtlMaxS)) * 1e6));
  wanted_ = Granted{.duty = duty,
                    .left = left,
                    .right = right,
                    .ways = ways,
                    .may_arm = may_arm,
                    .deadline_us = std::min(message.expiry_us, now_us() + ttl_us)};
}

/// All reasons that apply; kNone among them if it must or may be obeyed.
Codes Witness::setpoint_codes(uint64_t expiry_us, bool is_zero, uint8_t ways) {
  Codes codes;
  const uint64_t now = now_us();
  if (configuration_state_ == ConfigurationState::kBuiltIn) codes |= kBoardUnconfirmed;
  if (configuration_state_ == ConfigurationState::kTrial) codes |= kBoardOnTrial;
  if (restarting_) codes |= kBooting;
  if (!synchronised_) codes |= kClockUnsynchronised;
  const bool is_gap = now >= setpoint_us_ + gap_us();
  const bool perhaps_gap = may_be_gap();
  setpoint_us_ = now;
  if (expiry_us <= now) codes |= kExpired;
  if (trial_ == Trial::kExpired) codes |= kNoTrial;
  if (task_->before == SupervisorState::kEstopped) codes |= kEstopped;
  if (task_->before == SupervisorState::kFault) codes |= kFault;
  if (contradictions(values_) != 0) codes |= kContradiction;
  if (are_sensors_unread()) codes |= kBooting;
  if ((forbidden() & reflex::kStop) != 0) codes |= kFault;
  const bool rests = unarmed_ && !is_zero;
  if (rests && !perhaps_gap) codes |= kUnarmed;
  // Towards a bumper that is open it is obeyed, and held off.
  const bool is_free = ((forbidden() | perhaps_forbidden()) & ways) == 0;
  if ((held_ways_ & ways) != 0 && is_free && !perhaps_gap) codes |= kUnarmed;
  const bool perhaps_stopped = (perhaps_forbidden() & reflex::kStop) != 0;
  if (battery_.may_be_unread()) {
    if (codes.empty()) codes |= kNone;
    codes |= kBooting;
  }
  if (!codes.empty()) {
    if (perhaps_stopped) codes |= kFault;
    return codes;
  }
  codes |= kNone;
  if (rests && !is_gap) codes |= kUnarmed;
  if ((perhaps_held_ways_ & ways) != 0) codes |= kUnarmed;
  if (doubtful_contradictions(values_) != 0) codes |= kContradiction;
  if (perhaps_stopped) codes |= kFault;
  return codes;
}

uint64_t Witness::gap_us() const {
  return static_cast<uint64_t>(
      static_cast<double>(std::max(value(ParameterId::kRearmGapS), value(ParameterId::kTtlMaxS))) *
      1e6);
}

void Witness::read_request(uint32_t session_id, uint16_t request_id) {
  if (!open_ || session_id != session_id_) {
    task_->answers = true;
    task_->codes = kNoSession;
    return;
  }
  if (static_cast<int16_t>(request_id - newest_request_) <= 0) {
    for (const Kept& kept : kept_) {
      if (kept.request_id != request_id) continue;
      task_->is_repeat = task_->answers = true;
      task_->exact = kept.answer;
    }
    return;
  }
  task_->is_new = task_->answers = true;
  if (task_->message.id == ParameterTrial::kId) expires_trial();
  task_->codes = request_codes(task_->message);
  if (task_->codes.empty()) task_->codes = kNone;
  task_->records = !is_answered_afresh(task_->message.id) || !task_->codes.has(kNone);
}

/// The answer to a new message; nullopt: it was lost on the way.
void Witness::remembers(const std::optional<Seen>& answer) {
  if (!task_->records && !is_answered_afresh(task_->message.id)) return;
  newest_request_ = head_of(task_->message).request_id;
  if (task_->records) {
    kept_.push_back({newest_request_, answer});
    if (kept_.size() > kKeptAnswers) kept_.pop_front();
  } else {
    --newest_request_;  // A repeat of it is a new one.
  }
}

/// What outlasts a session cannot change now.
Codes Witness::lasting_code() const {
  return first_of(
      {when(trial_ == Trial::kRuns, kOnTrial), when(trial_ == Trial::kExpired, kNoTrial)});
}

Codes Witness::stopped_code() const {
  return first_of({lasting_code(), when(drives(), kNotStopped)});
}

/// Empty: it is carried out.
Codes Witness::request_codes(const Seen& message) const {
  switch (message.id) {
    case ClearEstop::kId:
      return when(contact_open(), kCausePresent);
    case ClearFault::kId:
      return fault_codes();
    case SetStreamRate::kId: {
      const uint32_t rate_hz = message.as<SetStreamRate>().rate_hz;
      const uint32_t capacity = simulator_.board.line.baud() / 10;
      constexpr uint32_t kFrame = WheelState::kSize + 10;
      const bool fits =
          capacity == 0 || rate_hz * kFrame * kLineShare[1] <= capacity * kLineShare[0];
      const bool is_fast = static_cast<float>(rate_hz) > value(ParameterId::kControlRateHz);
      return when(is_fast || !fits, kRateTooHigh);
    }
    case ParameterGet::kId: {
      const uint8_t id = message.as<ParameterGet>().parameter;
      return when(id < 1 || id > kParameterCount, kUnknownParameter);
    }
    case ParameterList::kId:
      return when(message.as<ParameterList>().parameter_index >= kParameterCount, kOutOfRange);
    case ParameterSet::kId:
      return codes(message.as<ParameterSet>());
    case ParameterSave::kId: {
      const uint8_t id = message.as<ParameterSave>().parameter;
      // One value is not saved over others that cannot be read.
      const bool cannot_read = id != 0 && (lasting_ & kStoreFaults) != 0;
      return first_of({when(id > kParameterCount, kUnknownParameter), stopped_code(),
                       when(cannot_read, kStoreFailed), save_codes()});
    }
    case ParameterReset::kId: {
      const Codes refused = first_of({lasting_code(), when(estopped() || drives(), kNotStopped)});
      if (!refused.empty()) return refused;
      Codes codes = kNone;
      const bool writes = save_failed_ || (lasting_ & kStoreFaults) != 0;
      if (writes || saved_ != Slots::Exists::kNo) {
        // Formatting is a write to the store, too.
        const bool formats = flash_damaged_ && !simulator_.board.store.failing;
        codes = !formats                                       ? save_codes()
                : simulator_.board.configuration_store.failing ? Codes(kStoreFailed)
                                                               : kNone;
        if (!writes && saved_ == Slots::Exists::kMaybe) codes |= kNone;
      }
      if (may_turn()) codes |= kNotStopped;
      return codes;
    }
    case ParameterTrial::kId:
      return codes(message.as<ParameterTrial>());
    case BoxGet::kId:
    case BoxRead::kId:
    case LedgerGet::kId:
    case UnsavedGet::kId:
      return when(drives(), kNotStopped);
    case Restart::kId:
      return fresh_candidate_ ? configuration_codes({}) : stopped_code();
    case PeripheralSet::kId:
      return when(message.as<PeripheralSet>().channel >= kMostPeripherals, kOutOfRange);
    case ConfigurationWrite::kId: {
      const auto request = message.as<ConfigurationWrite>();
      Configuration wanted = staged_;
      wanted.peripherals.count = request.peripheral_count;
      const bool is_meant = request.peripheral_count <= kMostPeripherals &&
                            wanted.fingerprint() == request.fingerprint && can_be_used(wanted);
      const bool on_trial = configuration_state_ == ConfigurationState::kTrial;
      return configuration_codes({when(on_trial, kBoardOnTrial), when(!is_meant, kBoardRefused)});
    }
    case ConfigurationConfirm::kId: {
      const bool waits = configuration_state_ == ConfigurationState::kTrial ||
                         configuration_state_ == ConfigurationState::kBuiltIn;
      const bool is_meant =
          message.as<ConfigurationConfirm>().fingerprint == configuration_.fingerprint();
      return configuration_codes({when(!waits, kNoBoardOnTrial), when(!is_meant, kBoardRefused)});
    }
    case MemoryGet::kId:
      return kNotSupported;  // The simulator is not a chip.
    default:
      return {};
  }
}

/// Result of saving parameters if nothing else prevents it. The configuration's store records that
/// there are some, once.
Codes Witness::save_codes() const {
  if (simulator_.board.store.failing || flash_damaged_) return kStoreFailed;
  if (!simulator_.board.configuration_store.failing) return kNone;
  // One that is damaged records nothing before another one is written.
  if (may_be_lost(StoredBlock::kConfiguration)) return kNone;
  switch (slots_of(StoredBlock::kParameterValues).exists) {
    case Slots::Exists::kYes:
      return kNone;
    case Slots::Exists::kNo:
      return kStoreFailed;
    case Slots::Exists::kMaybe:
      break;
  }
  Codes codes = kNone;
  codes |= kStoreFailed;
  return codes;
}

/// `refused`: the reasons against it other than the robot's state.
Codes Witness::configuration_codes(std::initializer_list<Codes> refused) const {
  return first_of({stopped_code(), when(board_confirmed() && estopped(), kEstopped),
                   first_of(refused), when(cannot_write_configuration(), kStoreFailed)});
}

/// A fault that a sensor caused lasts as long as it is triggered.
Codes Witness::fault_codes() const {
  if (lasting_ != 0) return kCausePresent;
  if ((simulator_.faults() & fault::kExternal) == 0) return kNone;
  if ((forbidden() & reflex::kStop) != 0 || are_sensors_unread()) return kCausePresent;
  Codes codes = kNone;
  if ((perhaps_forbidden() & reflex::kStop) != 0 || battery_.may_be_unread())
    codes |= kCausePresent;
  return codes;
}

// --- sensors -------------------------------------------------------------------------------------

/// What the triggered sensors of the active list forbid now.
uint8_t Witness::triggered() const {
  if (!board_confirmed()) return 0;
  const sim::Sensors& sensors = simulator_.board.sensors;
  // A pin that the board uses otherwise shows the sensor's input open, which is high.
  const auto is_open = [this](const Peripheral& entry) {
    return !simulator_.board.is_free(entry.pin_a);
  };
  uint8_t forbidden = 0;
  for (const Peripheral& entry : peripherals()) {
    const auto place = static_cast<size_t>(entry.place);
    const bool is_front = entry.place == Place::kFrontLeft || entry.place == Place::kFrontRight;
    if (entry.kind == PeripheralKind::kBumper && (sensors.bumpers[place] || is_open(entry)))
      forbidden |= is_front ? reflex::kNoForward : reflex::kNoReverse;
    if (entry.kind == PeripheralKind::kCliff && (sensors.cliffs[place] || is_open(entry)))
      forbidden |= reflex::kStop;
    if (entry.kind == PeripheralKind::kStageFault && sensors.stage_fault && !is_open(entry))
      forbidden |= reflex::kStop;
  }
  return forbidden;
}

const char* Witness::steps() {
  expires_trial();
  constexpr uint64_t kReleasedUs = 80'000;
  sensors_unread_ = false;
  const uint8_t now = triggered();
  if (now_us() >= touched_us_ + kReleasedUs) touched_ = 0;
  forbidden_ = now;
  perhaps_forbidden_ = now | touched_;
  const char* const what = battery_.reads(simulator_.board.battery.millivolts(), now_us());
  if (may_have_moved()) moved_us_ = now_us();
  for (const sim::Side wheel : sim::kSides)
    seen_ticks_[wheel] = simulator_.board.encoders[wheel].shown_ticks();
  // What it did not do because of a bumper.
  if (drives() && granted_) {
    constexpr uint32_t kWays = reflex::kNoForward | reflex::kNoReverse;
    held_ways_ |= static_cast<uint8_t>(forbidden() & granted_->ways & kWays);
    perhaps_held_ways_ |= static_cast<uint8_t>(perhaps_forbidden() & granted_->ways & kWays);
  }
  return what;
}

bool Witness::may_have_moved() const {
  return std::any_of(sim::kSides.begin(), sim::kSides.end(), [this](sim::Side wheel) {
    const sim::Quadrature& encoder = simulator_.board.encoders[wheel];
    return encoder.model.stuck != 0 || encoder.shown_ticks() != seen_ticks_[wheel];
  });
}

bool Witness::may_turn() const {
  constexpr uint64_t kMayTurnUs = 650'000;
  return may_have_moved() || now_us() - moved_us_ <= kMayTurnUs;
}

void Witness::notes_touch() {
  touched_us_ = now_us();
  touched_ |= triggered();
  perhaps_forbidden_ |= touched_;
  // It may be free again before the next step, which then does not see it.
  forbidden_ &= triggered();
}

Codes Witness::codes(const ParameterSet& request) const {
  if (request.parameter < 1 || request.parameter > kParameterCount) return kUnknownParameter;
  if (!std::isfinite(request.value)) return kNotFinite;
  const ParameterSpec& spec = kParameters[request.parameter - 1];
  if (request.value < spec.minimum || request.value > spec.maximum) return kOutOfRange;
  if (spec.kind != ParameterKind::kReal && request.value != std::floor(request.value))
    return kNotIntegral;
  if (request.value == value(spec.id)) return kNone;
  if (trial_ == Trial::kExpired) return kNoTrial;
  const bool released = spec.changes == ParameterChanges::kReleased;
  if (released && trial_ == Trial::kRuns) return kOnTrial;
  const SupervisorState state = contact_open() ? SupervisorState::kEstopped : simulator_.state();
  const bool drives = state == SupervisorState::kDriving;
  if ((drives && spec.changes != ParameterChanges::kAlways) ||
      (released && state == SupervisorState::kEstopped))
    return kNotStopped;
  Codes codes = kNone;
  if (spec.changes != ParameterChanges::kAlways && may_turn()) codes |= kNotStopped;
  Values changed = values_;
  changed[request.parameter - 1U] = request.value;
  const uint32_t known = contradictions(values_);
  if (trial_ == Trial::kRuns && !drives) return codes;
  if ((contradictions(changed) & ~known) != 0) {
    const bool may_be_refused_before = codes.has(kNotStopped);
    codes = kContradiction;
    if (may_be_refused_before) codes |= kNotStopped;
    return codes;
  }
  if ((doubtful_contradictions(changed) | doubtful_contradictions(values_)) != 0)
    codes |= kContradiction;
  return codes;
}

Codes Witness::codes(const ParameterTrial& request) const {
  const bool extends =
      request.action == TrialAction::kBegin || request.action == TrialAction::kRenew;
  if (extends) {
    if (!std::isfinite(request.timeout_s)) return kNotFinite;
    if (request.timeout_s < 0.2f || request.timeout_s > 60.0f) return kOutOfRange;
    if (request.action == TrialAction::kRenew) return trial_ == Trial::kRuns ? kNone : kNoTrial;
    return first_of({lasting_code(), kNone});
  }
  if (request.action == TrialAction::kRevert) return kNone;
  if (request.action != TrialAction::kKeep) return kOutOfRange;
  if (trial_ != Trial::kRuns) return kNoTrial;
  const uint32_t fresh = contradictions(values_) & ~contradictions(before_trial_);
  if (fresh != 0) return kContradiction;
  Codes codes = kNone;
  if ((doubtful_contradictions(values_) | doubtful_contradictions(before_trial_)) != 0)
    codes |= kContradiction;
  return codes;
}

// --- what it sends -------------------------------------------------------------------------------

Finding Witness::sends(const Seen& message) {
  if (message.id == WheelState::kId || is_of_sensors(message.id)) return {};
  if (message.id == Hold::kId && message.as<Hold>().request_id == 0)
    return tells(message.as<Hold>());
  if (message.id == Event::kId) {
    // It may be of the trial's end, which comes before the messages of a step.
    if (!task_) expires_trial();
    return {};
  }
  if (!task_ || !task_->answers || task_->answered) {
    // A setpoint may be refused where it need not be.
    const bool is_refusal = message.id == Refuse::kId && task_ && is_setpoint(task_->message.id) &&
                            task_->is_new && !task_->answered;
    if (!is_refusal)
      return {"answers-as-specified"_rule,
              "sent " + describe(message) + " without having been asked"};
  }
  task_->answered = true;
  return takes_effect(message);
}

/// The device's own report of what holds it must name everything known to hold it.
Finding Witness::tells(const Hold& hold) const {
  const uint8_t forbids = forbidden();
  const SupervisorState state = simulator_.state();
  const bool on_trial = configuration_state_ == ConfigurationState::kTrial;
  const bool unusable = configuration_state_ == ConfigurationState::kDamaged;
  const struct {
    bool holds;
    uint32_t flags;
    const char* name;
  } known[] = {
      {restarting_, held::kBooting, "BOOTING"},
      {(forbids & reflex::kNoForward) != 0,
       held::kBumperFront | held::kBumperFrontLeft | held::kBumperFrontRight, "BUMPER_FRONT..."},
      {(forbids & reflex::kNoReverse) != 0,
       held::kBumperRear | held::kBumperRearLeft | held::kBumperRearRight, "BUMPER_REAR..."},
      {(forbids & reflex::kStop) != 0,
       held::kCliff | held::kFaultInput | held::kBattery | held::kBatteryUnknown,
       "CLIFF, FAULT_INPUT or BATTERY..."},
      {contact_open(), held::kContact, "CONTACT"},
      {state == SupervisorState::kEstopped, held::kEstop, "ESTOP"},
      {state == SupervisorState::kFault, held::kFault, "FAULT"},
      {configuration_state_ == ConfigurationState::kBuiltIn, held::kConfigurationUnconfirmed,
       "CONFIGURATION_UNCONFIRMED"},
      {on_trial, held::kConfigurationOnTrial, "CONFIGURATION_ON_TRIAL"},
      {unusable, held::kConfigurationUnusable, "CONFIGURATION_UNUSABLE"},
      {contradictions(values_) != 0, held::kContradiction, "CONTRADICTION"},
      {trial_ == Trial::kExpired, held::kTrialOver, "TRIAL_OVER"},
  };
  for (const auto& one : known)
    if (one.holds && (hold.held & one.flags) == 0)
      return {"hold-is-named"_rule, std::string(one.name) + " holds it, and is not named"};
  if (state != SupervisorState::kEstopped && (hold.held & held::kEstop) != 0)
    return {"hold-is-named"_rule, "it names an e-stop that is not latched"};
  if (simulator_.faults() == 0 && (hold.held & held::kFault) != 0)
    return {"hold-is-named"_rule, "it names a fault that is not latched"};
  return {};
}

/// Checks the answer to the task, and takes note of what it says.
Finding Witness::takes_effect(const Seen& answer) {
  const Seen& message = task_->message;
  const auto wrong = [&](const std::string& what) {
    const Rule rule = task_->is_repeat ? "request-once"_rule : "answers-as-specified"_rule;
    return Finding{rule,
                   "answered " + describe(message) + " with " + describe(answer) + ": " + what};
  };
  if (message.id == Hello::kId) {
    if (answer.id != DeviceHello::kId) return wrong("a hello is answered with DeviceHello");
    return opens(answer.as<DeviceHello>());
  }
  if (task_->is_repeat) {
    if (task_->exact && !(*task_->exact == answer))
      return wrong("the first time it was " + describe(*task_->exact));
    return {};
  }
  if (answer.id == Refuse::kId) {
    const auto refuse = answer.as<Refuse>();
    if (refuse.message_id != message.id) return wrong("it names another message");
    task_->refusal = refuse.code;
    if (!task_->codes.has(refuse.code)) return wrong("expected " + task_->codes.text());
    if (is_setpoint(message.id)) denied_ = refuse.code;
  } else {
    if (!task_->codes.has(kNone)) return wrong("expected " + task_->codes.text());
    if (answer.id != answer_to(message.id)) return wrong("another answer belongs to it");
    task_->carried_out = true;
  }
  if (task_->is_new) remembers(answer);
  const bool failed = task_->refusal == kStoreFailed;
  if (message.id == ConfigurationWrite::kId && failed) fresh_candidate_ = false;
  // Only the record of it may have failed.
  const bool is_save = message.id == ParameterSave::kId || message.id == ParameterReset::kId;
  if (is_save && (failed || task_->carried_out)) save_failed_ = failed;
  if (is_save && task_->carried_out)
    saved_ = message.id == ParameterReset::kId ? Slots::Exists::kNo : Slots::Exists::kYes;
  if (is_save && failed && !simulator_.board.store.failing) {
    flashes_.push_back(flash());
    change_flash(message, flashes_.back());
    Slots::Exists& exists = slots_of(StoredBlock::kParameterValues).exists;
    if (exists == Slots::Exists::kNo) exists = Slots::Exists::kMaybe;
  }
  // A save that fails for good leaves the values as they are set; so does a reset of them.
  if (message.id == ParameterReset::kId && failed) values_ = defaults();
  if (task_->carried_out && (task_->is_new || message.id == Ping::kId)) acts(message);
  return {};
}

Finding Witness::opens(const DeviceHello& hello) {
  if (!task_->codes.has(hello.refusal))
    return {"answers-as-specified"_rule,
            "answered Hello with " + name_of(hello.refusal) + ": expected " + task_->codes.text()};
  if (!task_->is_new) return {};
  task_->carried_out = true;
  ends_session();
  open_ = true;
  nonce_ = hello.nonce;
  session_id_ = hello.nonce ^ simulator_.boot_id();
  synchronised_ = false;
  setpoint_us_ = now_us();
  newest_command_ = 0;
  newest_request_ = 0;
  kept_.clear();
  fresh_candidate_ = false;
  staged_ = {};
  return {};
}

void Witness::ends_session() {
  if (trial_ == Trial::kRuns) values_ = before_trial_;
  trial_ = Trial::kNone;
  granted_.reset();
}

void Witness::expires_trial() {
  if (trial_ != Trial::kRuns || now_us() < trial_until_us_) return;
  ends_session();
  trial_ = Trial::kExpired;
}

/// The message is carried out.
void Witness::acts(const Seen& message) {
  for (Flash& flash : flashes_) change_flash(message, flash);
  switch (message.id) {
    case Stop::kId: {
      const auto stop = message.as<Stop>();
      if (open_ && stop.session_id == session_id_)
        newest_command_ = std::max(newest_command_, stop.command_seq);
      granted_.reset();
      return;
    }
    case Estop::kId:
      granted_.reset();
      return;
    case Ping::kId:
      synchronised_ = true;
      return;
    case ClearEstop::kId:
    case ClearFault::kId: {
      const SupervisorState latched =
          message.id == ClearEstop::kId ? SupervisorState::kEstopped : SupervisorState::kFault;
      if (task_->before != latched) return;
      unarmed_ = cleared_ = true;
      setpoint_us_ = now_us();
      return;
    }
    case ParameterSet::kId: {
      const auto request = message.as<ParameterSet>();
      values_[request.parameter - 1U] = request.value;
      return;
    }
    case ParameterReset::kId:
      values_ = defaults();
      lasting_ &= ~kStoreFaults;
      flash_damaged_ = false;
      return;
    case ParameterSave::kId:
      lasting_ &= ~kStoreFaults;
      return;
    case ParameterTrial::kId:
      return acts(message.as<ParameterTrial>());
    case Restart::kId:
      restarting_ = true;
      return;
    case BoardSet::kId:
      staged_.board = BoardDescription::decode(message.body.data() + message.body.size() -
                                               BoardDescription::kSize);
      return;
    case PeripheralSet::kId: {
      const uint8_t* const entry = message.body.data() + message.body.size() - Peripheral::kSize;
      staged_.peripherals.entries[message.as<PeripheralSet>().channel] = Peripheral::decode(entry);
      return;
    }
    case ConfigurationWrite::kId:
      fresh_candidate_ = true;
      return;
    case ConfigurationConfirm::kId:
      fresh_candidate_ = false;
      if (configuration_state_ == ConfigurationState::kTrial) {
        configuration_state_ = ConfigurationState::kStored;
      } else {
        restarting_ = true;
      }
      return;
  }
}

void Witness::acts(const ParameterTrial& request) {
  const auto until_us = now_us() + static_cast<uint64_t>(request.timeout_s * 1e6f);
  switch (request.action) {
    case TrialAction::kBegin:
      before_trial_ = values_;
      trial_ = Trial::kRuns;
      trial_until_us_ = until_us;
      return;
    case TrialAction::kRenew:
      trial_until_us_ = until_us;
      return;
    case TrialAction::kKeep:
      trial_ = Trial::kNone;
      return;
    case TrialAction::kRevert:
      if (trial_ == Trial::kRuns) ends_session();
      trial_ = Trial::kNone;
      return;
  }
}

/// The flash after the message, if all of its writes succeed.
void Witness::change_flash(const Seen& message, Flash& flash) const {
  switch (message.id) {
    case ParameterSave::kId: {
      const uint8_t id = message.as<ParameterSave>().parameter;
      Values saved = values_;
      if (id != 0) {
        saved = loaded(flash);
        saved[id - 1U] = values_[id - 1U];
      }
      flash.parameters = saved;
      flash.parameters_board = board_checksum();
      return;
    }
    case ParameterReset::kId:
      flash.parameters.reset();
      return;
    case ConfigurationWrite::kId: {
      Configuration wanted = staged_;
      wanted.peripherals.count = message.as<ConfigurationWrite>().peripheral_count;
      flash.candidate = packed(wanted);
      flash.candidate_state = Candidate::kWritten;
      // What cannot be loaded is not written again.
      if (configuration_state_ == ConfigurationState::kDamaged) {
        flash.confirmed.reset();
        flash.is_lost = true;
      }
      return;
    }
    case Restart::kId:
      if (fresh_candidate_) flash.candidate_state = Candidate::kRequested;
      return;
    case ConfigurationConfirm::kId:
      flash.confirmed = packed(configuration_);
      flash.is_lost = false;
      flash.candidate_state = Candidate::kNone;
      return;
  }
}

// --- between two messages ------------------------------------------------------------------------

Finding Witness::settles() {
  if (!task_) return {};
  const bool room = simulator_.board.line.has_room(kLongestFrames);
  Finding problem;
  // That a setpoint was obeyed which had to be refused shows in what drives.
  const bool obeyed = is_setpoint(task_->message.id) && drives();
  if (task_->answers && !task_->answered) {
    if (room && !obeyed) {
      problem.text =
          "did not answer " + describe(task_->message) + ", expected " + task_->codes.text();
    } else if (!room) {
      presumes();
    }
  }
  if (is_setpoint(task_->message.id) && task_->is_new && !task_->answered &&
      task_->codes.has(kNone)) {
    if (!room && !task_->codes.is_single()) lost_track_ = true;
    task_->carried_out = true;
    granted_ = wanted_;
    unarmed_ = false;
    // It may only have been obeyed because a bumper holds it off.
    if ((perhaps_held_ways_ & granted_->ways) == 0)
      held_ways_ = perhaps_held_ways_ = 0;
    else if (granted_->may_arm)
      held_ways_ = 0;
  }
  return problem;
}

/// The line was full, and the answer is lost.
void Witness::presumes() {
  if (!task_->is_new || is_setpoint(task_->message.id)) return;
  if (task_->message.id == Hello::kId) {
    opens({.nonce = task_->message.as<Hello>().nonce, .refusal = kNone});
    return;
  }
  if (!task_->codes.is_single()) lost_track_ = true;
  task_->carried_out = task_->codes.has(kNone);
  remembers(std::nullopt);
  if (task_->carried_out) acts(task_->message);
}

void Witness::notes_stop() {
  if (!drives()) granted_.reset();
}

// --- resets --------------------------------------------------------------------------------------

void Witness::writes(StoredBlock block, int slot) {
  Slots& written = slots_of(block);
  const bool was_gone = written.are_gone();
  written.whole[static_cast<size_t>(slot)] = true;
  written.formers.clear();
  if (block == StoredBlock::kLatches) {
    // A save writes both slots at once. A repair writes one, and what it writes may be older than
    // the state.
    if (now_us() == latch_write_us_ && slot != latch_write_slot_) {
      for (Flash& flash : flashes_) flash.estop = simulator_.state() == SupervisorState::kEstopped;
    }
    latch_write_us_ = now_us();
    latch_write_slot_ = slot;
  }
  // The configuration records another block after that was written.
  record_writes_ = block == StoredBlock::kConfiguration ? record_writes_ + 1 : 0;
  for (const StoredBlock other : {StoredBlock::kParameterValues, StoredBlock::kLatches}) {
    Slots& slots = slots_of(other);
    if (block == other && slots.exists == Slots::Exists::kNo) slots.exists = Slots::Exists::kMaybe;
    if (block != StoredBlock::kConfiguration) continue;
    if (was_gone && slots.are_gone()) slots.exists = Slots::Exists::kNo;
    if (record_writes_ >= 2 && slots.exists == Slots::Exists::kMaybe && !slots.are_gone())
      slots.exists = Slots::Exists::kYes;
  }
}

void Witness::formats() {
  for (Slots& slots : slots_) slots = {.formers = {}, .lost_copy = slots.lost_copy};
  flashes_ = {Flash{}};
}

void Witness::cut_at_write(StoredBlock block, int slot, sim::WriteFate fate) {
  Slots& slots = slots_of(block);
  const std::vector<Flash> before = flashes_;
  if (slots.formers.empty()) slots.formers = before;
  // The power may fail again before a start has shown which of them it is.
  for (Flash flash : before) {
    if (block == StoredBlock::kLatches) {
      flash.estop = !flash.estop;
    } else if (task_ && task_->is_new) {
      change_flash(task_->message, flash);
    } else {
      flash.candidate_state = boot_of(flash).candidate_state;  // A start writes what it tries.
    }
    flashes_.push_back(flash);
  }
  if (fate != sim::WriteFate::kUntouched)
    slots.whole[static_cast<size_t>(slot)] = fate == sim::WriteFate::kDone;
  if (slots.exists == Slots::Exists::kNo) slots.exists = Slots::Exists::kMaybe;
}

void Witness::damages(StoredBlock block, sim::Damage what) {
  Slots& slots = slots_of(block);
  if (what != sim::Damage::kSecond) slots.whole[0] = false;
  if (what != sim::Damage::kFirst) slots.whole[1] = false;
  const auto change = [&](Flash& flash, const Flash& other) {
    switch (block) {
      case StoredBlock::kConfiguration:
        flash.confirmed = other.confirmed;
        flash.candidate = other.candidate;
        flash.candidate_state = other.candidate_state;
        flash.is_lost = other.is_lost;
        return;
      case StoredBlock::kParameterValues:
        flash.parameters = other.parameters;
        flash.parameters_board = other.parameters_board;
        return;
      case StoredBlock::kLatches:
        flash.estop = other.estop;
        return;
    }
  };
  if (slots.are_gone()) {
    for (Flash& flash : flashes_) change(flash, {});
  } else {
    const std::vector<Flash> flashes = flashes_;
    for (const Flash& former : slots.formers) {
      for (Flash flash : flashes) {
        change(flash, former);
        flashes_.push_back(flash);
      }
    }
  }
}

/// Whether there was a block in slots that hold nothing. One that is recorded, for certain.
bool Witness::may_be_lost(StoredBlock block) const {
  if (!slots_of(block).are_gone()) return false;
  const bool has_configuration = !slots_of(StoredBlock::kConfiguration).are_gone();
  if (block != StoredBlock::kConfiguration)
    return has_configuration && slots_of(block).exists != Slots::Exists::kNo;
  return !slots_of(StoredBlock::kParameterValues).are_gone();
}

bool Witness::has_lost_copy() const {
  return std::any_of(slots_.begin(), slots_.end(),
                     [](const Slots& slots) { return slots.lost_copy && slots.is_half(); });
}

void Witness::resets(bool loses_memory) {
  if (last_state_ != SupervisorState::kBoot) {
    state_before_reset_ = last_state_;
    faults_before_reset_ = last_faults_;
    memory_kept_ = true;
  }
  if (loses_memory) memory_kept_ = false;
  battery_.resets(loses_memory);
  last_state_ = SupervisorState::kBoot;
  last_faults_ = 0;
  open_ = false;
  session_id_ = 0;
  kept_.clear();
  granted_.reset();
  task_.reset();
  trial_ = Trial::kNone;
  restarting_ = fresh_candidate_ = false;
  latch_write_us_ = UINT64_MAX;  // The device's time begins anew.
  staged_ = {};
}

Witness::Start Witness::boot_of(const Flash& flash) const {
  Start start;
  start.candidate_state = flash.candidate_state;
  // The wiring is unknown.
  if (simulator_.board.configuration_store.unreadable != 0 || simulator_.board.flash.faults != 0 ||
      may_be_lost(StoredBlock::kConfiguration))
    return start;
  const bool writable = !simulator_.board.configuration_store.failing;
  if (flash.candidate_state == Candidate::kRequested && writable) {
    start.candidate_state = Candidate::kTried;
    start.state = ConfigurationState::kTrial;
    start.configuration = unpacked(*flash.candidate);
    return start;
  }
  if (writable) start.candidate_state = Candidate::kNone;
  if (flash.is_lost) return start;
  if (flash.confirmed) {
    start.state = ConfigurationState::kStored;
    start.configuration = unpacked(*flash.confirmed);
  } else {
    start.state =
        simulator_.board_unwritten ? ConfigurationState::kBuiltIn : ConfigurationState::kStored;
    start.configuration = built_in_configuration(simulator_.board_unwritten);
  }
  return start;
}

Finding Witness::starts() {
  // If a block's first save was cut, the block may be lost, or may never have existed.
  std::vector<std::array<bool, kStoredBlocks>> losses{{}};
  for (const StoredBlock block : kBlocks) {
    const auto index = static_cast<size_t>(block);
    const size_t count = may_be_lost(block) ? losses.size() : 0;
    const bool is_certain =
        block == StoredBlock::kConfiguration || slots_of(block).exists == Slots::Exists::kYes;
    for (size_t i = 0; i < count; ++i) {
      if (!is_certain) losses.push_back(losses[i]);
      losses[i][index] = true;
    }
  }
  bool with_values = saved_ == Slots::Exists::kMaybe;
  bool without = with_values;
  save_failed_ = false;
  for (const Flash& flash : flashes_) (flash.parameters ? with_values : without) = true;
  saved_ = !with_values ? Slots::Exists::kNo
           : without    ? Slots::Exists::kMaybe
                        : Slots::Exists::kYes;
  Finding problem;
  bool is_first = true;
  Flash found = flash();
  for (const Flash& flash : flashes_) {
    for (const auto& lost : losses) {
      if (!is_first && problem.text.empty()) break;
      const Finding other = starts_from(flash, lost);
      if (other.text.empty()) {
        found = flash;
        problem.text.clear();
      } else {
        const bool is_of_cut = !is_first && problem.rule != "lost-is-not-empty"_rule;
        problem = {is_of_cut  ? "flash-old-or-new"_rule
                   : is_first ? other.rule
                              : problem.rule,
                   is_first ? other.text : problem.text + "; or else: " + other.text};
      }
      is_first = false;
    }
  }
  flashes_ = {found};
  record_writes_ = 0;
  // With the record its blocks are forgotten.
  for (Slots& slots : slots_) {
    if (slots.are_gone() && slots_of(StoredBlock::kConfiguration).are_gone())
      slots.exists = Slots::Exists::kNo;
    slots.lost_copy = slots.is_half();
  }
  if (problem.text.empty()) flashes_[0].candidate_state = boot_of(found).candidate_state;
  note_state();
  kept_memory_ = memory_kept_;
  memory_kept_ = false;
  setpoint_us_ = now_us();
  held_ways_ = perhaps_held_ways_ = 0;
  return problem;
}

Finding Witness::starts_from(const Flash& flash, const std::array<bool, kStoredBlocks>& lost) {
  const auto is_lost = [&lost](StoredBlock block) { return lost[static_cast<size_t>(block)]; };
  const Start start = boot_of(flash);
  configuration_state_ = start.state;
  configuration_ = start.configuration;
  if (simulator_.configuration_state() != start.state) {
    return {is_lost(StoredBlock::kConfiguration)          ? "lost-is-not-empty"_rule
            : start.state == ConfigurationState::kBuiltIn ? "confirmed-board-only"_rule
                                                          : "flash-old-or-new"_rule,
            "the configuration is " + name_of(simulator_.configuration_state()) + " instead of " +
                name_of(start.state)};
  }
  const bool has_one = start.state != ConfigurationState::kDamaged;
  if (simulator_.configuration_fingerprint() != (has_one ? configuration_.fingerprint() : 0))
    return {"flash-old-or-new"_rule, "it starts with another configuration than the confirmed one"};
  sensors_unread_ = board_confirmed() && peripherals().count != 0;
  forbidden_ = perhaps_forbidden_ = touched_ = 0;
  battery_.start(board_confirmed() ? peripherals() : PeripheralList{});
  flash_damaged_ = simulator_.board.flash.faults != 0;
  values_ = loaded(flash);
  lasting_ = simulator_.board.store.unreadable | simulator_.board.flash.faults;
  // If nothing can be read, this stays undetected.
  if (lasting_ == 0 && is_lost(StoredBlock::kParameterValues)) lasting_ = fault::kStoreUnreadable;
  if (simulator_.driver_failed()) lasting_ |= fault::kDriverFailed;
  if (!has_one) lasting_ |= fault::kNoBoard;
  if (lasting_ & kStoreFaults) values_ = defaults();
  for (const ParameterSpec& spec : kParameters) {
    if (simulator_.parameter(spec.id) != value(spec.id))
      return {spec.id == ParameterId::kEstopInputEnabled ? "contact-input-of-its-board"_rule
                                                         : "flash-old-or-new"_rule,
              "parameter " + std::to_string(static_cast<int>(spec.id)) + " is " +
                  text_of(static_cast<double>(simulator_.parameter(spec.id))) + " instead of " +
                  text_of(static_cast<double>(value(spec.id)))};
  }
  // A note in flash that cannot be read counts as an e-stop, whatever the memory says.
  const bool is_unreadable = is_lost(StoredBlock::kLatches) || simulator_.board.flash.faults != 0;
  const bool estop =
      is_unreadable ||
      (memory_kept_ ? state_before_reset_ == SupervisorState::kEstopped : flash.estop);
  const uint32_t faults = lasting_ | (memory_kept_ ? faults_before_reset_ & ~fault::kNoBoard : 0U);
  unarmed_ = true;
  cleared_ = false;
  const SupervisorState state = estop         ? SupervisorState::kEstopped
                                : faults != 0 ? SupervisorState::kFault
                                              : SupervisorState::kIdle;
  if (simulator_.state() != state)
    return {is_lost(StoredBlock::kLatches) || is_lost(StoredBlock::kParameterValues)
                ? "lost-is-not-empty"_rule
            : memory_kept_ ? "latch-ends-by-clear"_rule
                           : "estop-survives-power-loss"_rule,
            "it starts in " + name_of(simulator_.state()) + " instead of " + name_of(state)};
  if (simulator_.faults() != faults)
    return {is_lost(StoredBlock::kParameterValues) ? "lost-is-not-empty"_rule
                                                   : "latch-ends-by-clear"_rule,
            "it starts with the faults " + std::to_string(simulator_.faults()) + " instead of " +
                std::to_string(faults)};
  return {};
}

/// The values without a saved one.
Values Witness::defaults() const {
  Values values;
  for (size_t i = 0; i < kParameterCount; ++i) values[i] = kParameters[i].default_value;
  if (!board_confirmed()) return values;
  values[index_of(ParameterId::kPwmFrequencyHz)] = board().pwm_frequency_hz;
  values[index_of(ParameterId::kGlitchFilterNs)] = board().encoder_filter_ns;
  if (board().estop < 0) values[index_of(ParameterId::kEstopInputEnabled)] = 0;
  return values;
}

/// What a start makes of the flash.
Values Witness::loaded(const Flash& flash) const {
  if (!flash.parameters) return defaults();
  Values values = *flash.parameters;
  if (flash.parameters_board != board_checksum()) {
    const size_t contact = index_of(ParameterId::kEstopInputEnabled);
    values[contact] = defaults()[contact];
  }
  return values;
}

uint32_t Witness::board_checksum() const { return checksum(board()); }

// --- contradictions ------------------------------------------------------------------------------

uint32_t Witness::contradictions(const Values& values) const {
  return contradictions(values, kDoubt);
}

/// Within the rounding of the core's single precision.
uint32_t Witness::doubtful_contradictions(const Values& values) const {
  return contradictions(values, -kDoubt) & ~contradictions(values, kDoubt);
}

uint32_t Witness::contradictions(const Values& values, double doubt) const {
  const auto of = [&values](ParameterId id) { return static_cast<double>(values[index_of(id)]); };
  using enum ParameterId;
  const double rate_hz = of(kControlRateHz);
  const double turns_hz = of(kMaxVelocityMps) / (2.0 * std::numbers::pi * of(kWheelRadius));
  const double ticks_hz = turns_hz * of(kCountsPerRevolution);
  uint32_t flags = 0;
  if (of(kOverrunLimitUs) < 1.5e6 / rate_hz * (1.0 - doubt)) flags |= contradiction::kOverrunLimit;
  if (board_confirmed() &&
      of(kPwmFrequencyHz) > kStageTables[static_cast<size_t>(board().stage)].max_frequency_hz)
    flags |= contradiction::kPwmFrequency;
  if (of(kStreamRateHz) > rate_hz) flags |= contradiction::kStreamRate;
  if (of(kSupplyDropV) >= std::min(of(kNominalSupplyV), of(kUnmeasuredSupplyV)))
    flags |= contradiction::kSupplyDrop;
  if (ticks_hz >= rate_hz * (kCounterLimit / 2) * (1.0 + doubt)) flags |= contradiction::kTickRate;
  if (of(kGlitchFilterNs) * 1e-9 * ticks_hz >= 1.0 + doubt) flags |= contradiction::kGlitchFilter;
  return flags;
}

}  // namespace wheelwire::explore
