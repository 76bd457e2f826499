// What somebody knows who sees the bytes on the line, the contact, the power and the clock, but not
// into the firmware: sessions, setpoints that were granted, parameters, boards, latches. It is
// written from protocol/SPEC.md, and calls nothing that the core decides with.
#pragma once
#include <array>
#include <cmath>
#include <cstring>
#include <deque>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "battery_witness.hpp"
#include "names.hpp"
#include "own_board.hpp"
#include "peripheral_lists.hpp"
#include "rule_ids.hpp"
#include "shipped_boards.hpp"
#include "simulator.hpp"
#include "wire_decoder.hpp"

namespace wheelwire::explore {

using enum RefusalCode;

using Values = std::array<float, kParameterCount>;

constexpr size_t index_of(ParameterId id) { return static_cast<size_t>(id) - 1; }

/// A set of refusal codes; with kNone in it the message may be carried out.
class Codes {
 public:
  constexpr Codes() = default;
  constexpr Codes(RefusalCode code) : bits_(1U << static_cast<unsigned>(code)) {}

  Codes& operator|=(Codes other) {
    bits_ |= other.bits_;
    return *this;
  }

  friend Codes operator|(Codes a, Codes b) { return a |= b; }

  constexpr bool has(RefusalCode code) const {
    return (bits_ >> static_cast<unsigned>(code) & 1) != 0;
  }

  constexpr bool empty() const { return bits_ == 0; }
  constexpr bool is_single() const { return (bits_ & (bits_ - 1)) == 0; }

  std::string text() const {
    std::string text;
    for (unsigned code = 0; code < 32; ++code)
      if ((bits_ >> code & 1) != 0)
        text += (text.empty() ? "" : " or ") + name_of(static_cast<RefusalCode>(code));
    return text;
  }

 private:
  uint32_t bits_ = 0;
};

/// A setpoint that has every right to drive.
struct Granted {
  bool duty = false;
  double left = 0.0;  ///< m/s or -1..1, by `duty`.
  double right = 0.0;
  uint8_t ways = 0;      ///< Which way its wheels turn, as flags of `reflex`; 0: it is zero.
  bool may_arm = false;  ///< It came after a pause, perhaps.
  uint64_t deadline_us = 0;
};

/// How far the configuration that was written is on its way.
enum class Candidate { kNone, kWritten, kRequested, kTried };

/// What lies in flash.
struct Flash {
  std::optional<Values> parameters;  ///< None: the defaults.
  uint32_t parameters_board = 0;     ///< Checksum of the board that they were saved for.
  std::optional<Configuration> confirmed;
  std::optional<Configuration> candidate;
  Candidate candidate_state = Candidate::kNone;
  bool is_lost = false;  ///< The confirmed configuration was damaged: nothing drives until another
                         ///< is confirmed.
  bool estop = false;
};

/// The two slots of a block.
struct Slots {
  /// kMaybe: the first save was cut.
  enum class Exists { kNo, kMaybe, kYes };

  std::array<bool, 2> whole{};
  Exists exists = Exists::kNo;
  std::vector<Flash> formers;  ///< What the other slot may still hold, because a save was cut.
  bool lost_copy = false;      ///< The last start found only one of the two.

  bool is_half() const { return whole[0] != whole[1]; }
  bool are_gone() const { return !whole[0] && !whole[1]; }
};

/// The message that the firmware handles, and what it has to answer.
struct Task {
  Seen message;
  SupervisorState before{};
  bool is_new = false;     ///< Not a repeat, not too old, not of another session.
  bool is_zero = false;    ///< A setpoint that does not turn a wheel.
  bool is_repeat = false;  ///< Answered from the stored answers, and not carried out again.
  bool answers = false;    ///< An answer must come.
  bool answered = false;
  bool records = false;  ///< The device stores the answer for repeats.
  bool carried_out = false;
  RefusalCode refusal = RefusalCode::kNone;
  Codes codes;                ///< The answer is one of these.
  std::optional<Seen> exact;  ///< The answer to a repeat, where it is known.
};

/// The answer to a request, for repeats of it.
struct Kept {
  uint16_t request_id = 0;
  std::optional<Seen> answer;
};

enum class Trial { kNone, kRuns, kExpired };

class Witness {
 public:
  explicit Witness(sim::Simulator& simulator) : simulator_(simulator), robot_(simulator.board) {}

  // What is seen, in order. Functions that return a finding say what is wrong.
  /// The firmware reads a message, and is about to handle it.
  void reads(const Seen& message) {
    task = Task{.message = message, .before = simulator_.state(), .codes = {}, .exact = {}};
    wanted_.reset();
    switch (message.id) {
      case Hello::kId:
        return read_hello(message.as<Hello>());
      case Stop::kId:
      case Estop::kId:
        task->answers = task->is_new = true;
        task->codes = kNone;
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
        task->answers = task->is_new = true;
        task->codes =
            session.open && message.as<Ping>().session_id == session.id ? kNone : kNoSession;
        return;
      default:
        if (message.id >= kFirstDeviceId) {
          task.reset();
          return;
        }
        return read_request(head_of(message).session_id, head_of(message).request_id);
    }
  }

  Finding sends(const Seen& message) {
    if (message.id == WheelState::kId || is_of_sensors(message.id)) return {};
    if (message.id == Hold::kId && message.as<Hold>().request_id == 0)
      return tells(message.as<Hold>());
    if (message.id == Event::kId) {
      // It may be of the trial's end, which comes before the messages of a step.
      if (!task) expires_trial();
      return {};
    }
    if (!task || !task->answers || task->answered) {
      // A setpoint may be refused where it need not be.
      const bool is_refusal = message.id == Refuse::kId && task && is_setpoint(task->message.id) &&
                              task->is_new && !task->answered;
      if (!is_refusal)
        return {"answers-as-specified"_rule,
                "sent " + describe(message) + " without having been asked"};
    }
    task->answered = true;
    return takes_effect(message);
  }

  /// It has handled the message: it reads on, or its call has ended.
  Finding settles() {
    if (!task) return {};
    const bool room = robot_.line.has_room(kLongestFrames);
    Finding problem;
    // That a setpoint was obeyed which had to be refused shows in what drives.
    const bool obeyed = is_setpoint(task->message.id) && drives();
    if (task->answers && !task->answered) {
      if (room && !obeyed) {
        problem.text =
            "did not answer " + describe(task->message) + ", expected " + task->codes.text();
      } else if (!room) {
        presumes();
      }
    }
    if (is_setpoint(task->message.id) && task->is_new && !task->answered &&
        task->codes.has(kNone)) {
      if (!room && !task->codes.is_single()) lost_track = true;
      task->carried_out = true;
      granted = wanted_;
      unarmed_ = false;
      // It may only have been obeyed because a bumper holds it off.
      if ((perhaps_held_ways & granted->ways) == 0)
        held_ways = perhaps_held_ways = 0;
      else if (granted->may_arm)
        held_ways = 0;
    }
    return problem;
  }

  /// A control step has ended.
  void steps() {
    expires_trial();
    constexpr uint64_t kReleasedUs = 80'000;
    sensors_unread_ = false;
    if (now_us() >= touched_us_ + kReleasedUs) touched_ = 0;
    forbidden_ = triggered();
    battery_.reads(robot_.battery.millivolts(), now_us());
    if (may_have_moved()) moved_us_ = now_us();
    for (const sim::Side wheel : sim::kSides)
      seen_ticks_[wheel] = robot_.encoders[wheel].shown_ticks();
    // What it did not do because of a bumper.
    if (drives() && granted) {
      constexpr uint32_t kWays = reflex::kNoForward | reflex::kNoReverse;
      held_ways |= static_cast<uint8_t>(forbidden() & granted->ways & kWays);
      perhaps_held_ways |= static_cast<uint8_t>(perhaps_forbidden() & granted->ways & kWays);
    }
  }

  /// Once the robot does not drive, its setpoint does not count any more.
  void notes_stop() {
    if (!drives()) granted.reset();
  }

  /// It writes a slot.
  void writes(StoredBlock block, int slot) {
    Slots& written = slots_of(block);
    const bool was_gone = written.are_gone();
    written.whole[static_cast<size_t>(slot)] = true;
    written.formers.clear();
    if (block == kLatches) {
      // A save writes both slots at once. A repair writes one, and what it writes may be older than
      // the state.
      if (now_us() == latch_write_us_ && slot != latch_write_slot_) {
        for (Flash& flash : flashes_) flash.estop = simulator_.state() == State::kEstopped;
      }
      latch_write_us_ = now_us();
      latch_write_slot_ = slot;
    }
    // The configuration records another block after that was written.
    record_writes_ = block == kConfiguration ? record_writes_ + 1 : 0;
    for (const StoredBlock other : {kParameterValues, kLatches}) {
      Slots& slots = slots_of(other);
      if (block == other && slots.exists == kNo) slots.exists = kMaybe;
      if (block != kConfiguration) continue;
      if (was_gone && slots.are_gone()) slots.exists = kNo;
      if (record_writes_ >= 2 && slots.exists == kMaybe && !slots.are_gone()) slots.exists = kYes;
    }
  }

  /// The power goes at a write, which is done or not, or has lost what was in the slot.
  void cut_at_write(StoredBlock block, int slot, sim::WriteFate fate) {
    Slots& slots = slots_of(block);
    const std::vector<Flash> before = flashes_;
    if (slots.formers.empty()) slots.formers = before;
    // The power may fail again before a start has shown which of them it is.
    for (Flash flash : before) {
      if (block == kLatches) {
        flash.estop = !flash.estop;
      } else if (task && task->is_new) {
        change_flash(task->message, flash);
      } else {
        flash.candidate_state = boot_of(flash).candidate_state;  // A start writes what it tries.
      }
      flashes_.push_back(flash);
    }
    if (fate != sim::WriteFate::kUntouched)
      slots.whole[static_cast<size_t>(slot)] = fate == sim::WriteFate::kDone;
    if (slots.exists == kNo) slots.exists = kMaybe;
  }

  /// All stores are formatted.
  void formats() {
    for (Slots& slots : slots_) slots = {.formers = {}, .lost_copy = slots.lost_copy};
    flashes_ = {Flash{}};
  }

  /// Time has damaged slots of a block.
  void damages(StoredBlock block, sim::Damage what) {
    Slots& slots = slots_of(block);
    if (what != sim::Damage::kSecond) slots.whole[0] = false;
    if (what != sim::Damage::kFirst) slots.whole[1] = false;
    const auto change = [&](Flash& flash, const Flash& other) {
      switch (block) {
        case kConfiguration:
          flash.confirmed = other.confirmed;
          flash.candidate = other.candidate;
          flash.candidate_state = other.candidate_state;
          flash.is_lost = other.is_lost;
          return;
        case kParameterValues:
          flash.parameters = other.parameters;
          flash.parameters_board = other.parameters_board;
          return;
        case kLatches:
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

  /// The chip was reset, and begins to boot.
  void resets(bool loses_memory) {
    if (last_state != State::kBoot) {
      state_before_reset_ = last_state;
      faults_before_reset_ = last_faults;
      kept_memory = true;
    }
    if (loses_memory) kept_memory = false;
    battery_.resets(loses_memory);
    last_state = State::kBoot;
    last_faults = 0;
    session = {};
    granted.reset();
    task.reset();
    trial = Trial::kNone;
    restarting_ = false;
    latch_write_us_ = UINT64_MAX;  // The device's time begins anew.
  }

  /// It has started.
  Finding starts() {
    // If a block's first save was cut, the block may be lost, or may never have existed.
    std::vector<std::array<bool, kStoredBlocks>> losses{{}};
    for (const StoredBlock block : kBlocks) {
      const auto index = static_cast<size_t>(block);
      const size_t count = may_be_lost(block) ? losses.size() : 0;
      const bool is_certain = block == kConfiguration || slots_of(block).exists == kYes;
      for (size_t i = 0; i < count; ++i) {
        if (!is_certain) losses.push_back(losses[i]);
        losses[i][index] = true;
      }
    }
    bool with_values = saved_ == kMaybe;
    bool without = with_values;
    save_failed_ = false;
    for (const Flash& flash : flashes_) (flash.parameters ? with_values : without) = true;
    saved_ = !with_values ? kNo : without ? kMaybe : kYes;
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
      if (slots.are_gone() && slots_of(kConfiguration).are_gone()) slots.exists = kNo;
      slots.lost_copy = slots.is_half();
    }
    if (problem.text.empty()) flashes_[0].candidate_state = boot_of(found).candidate_state;
    note_state();
    setpoint_us_ = now_us();
    held_ways = perhaps_held_ways = 0;
    return problem;
  }

  void drivers_fail() { lasting_ |= fault::kDriverFailed; }
  // What is known, for the rules to read.
  /// What ends with a session.
  struct Session {
    bool open = false;
    uint32_t id = 0;
    bool synchronised = false;
    uint32_t newest_command = 0;
    uint16_t newest_request = 0;
    std::deque<Kept> kept{};
    bool fresh_candidate = false;  ///< A configuration was written.
    Configuration staged{};        ///< What was set.
  };
  Session session;
  std::optional<Granted> granted;
  /// Why the last setpoint that was not granted was not.
  Codes denied;
  Trial trial = Trial::kNone;
  uint64_t trial_until_us = 0;
  std::optional<Task> task;
  ConfigurationState configuration_state = kDamaged;
  /// Which way a bumper held it off, as flags of `reflex`: it is not to go there until it is armed.
  uint8_t held_ways = 0;
  /// Which way it may not go.
  uint8_t perhaps_held_ways = 0;
  /// Memory that outlives a reset of the processor was not lost before this start.
  bool kept_memory = false;
  // State and faults, as they were last seen before the firmware went on.
  SupervisorState last_state = State::kBoot;
  uint32_t last_faults = 0;
  /// An answer was lost, and what became of its request is not known.
  bool lost_track = false;

  const Values& values() const { return values_; }
  float value(ParameterId id) const { return values_[index_of(id)]; }
  const Flash& flash() const { return flashes_[0]; }
  /// The active one; empty if there is none.
  const Configuration& configuration() const { return configuration_; }
  const BoardDescription& board() const { return configuration_.board; }
  const PeripheralList& peripherals() const { return configuration_.peripherals; }

  bool board_confirmed() const {
    return configuration_state == kStored || configuration_state == kTrial;
  }

  /// What the sensors forbid for certain, as flags of `reflex`: they are triggered, and were so
  /// when the firmware last read them.
  uint8_t forbidden() const {
    return forbidden_ | battery_.forbids(robot_.battery.millivolts(), now_us());
  }

  /// What they may forbid: they were triggered a moment ago.
  uint8_t perhaps_forbidden() const {
    return forbidden_ | touched_ | battery_.may_forbid(robot_.battery.millivolts(), now_us());
  }

  /// Somebody touched one.
  void notes_touch() {
    touched_us_ = now_us();
    touched_ |= triggered();
    // It may be free again before the next step, which then does not see it.
    forbidden_ &= triggered();
  }

  /// Whether a start, not a clear, was what disarmed it.
  bool unarmed_by_start() const { return unarmed_ && !cleared_; }

  /// Whether a start found only one of two copies of a block, and the other one is not written yet.
  bool has_lost_copy() const {
    return std::ranges::any_of(
        slots_, [](const Slots& slots) { return slots.lost_copy && slots.is_half(); });
  }

  /// State and faults, as they were last seen before the firmware went on.
  void note_state() {
    last_state = simulator_.state();
    last_faults = simulator_.faults();
  }

  /// It stops the robot, if it counts.
  bool contact_open() const {
    return board_confirmed() && board().estop >= 0 && value(ParameterId::kEstopInputEnabled) != 0 &&
           robot_.estop.is_open();
  }

  bool contradicts() const { return contradictions(values_) != 0; }
  void forgets_task() { task.reset(); }

 private:
  using enum StoredBlock;
  using enum ConfigurationState;
  using enum Slots::Exists;
  using State = SupervisorState;

  static constexpr size_t kKeptAnswers = 4;
  static constexpr double kDoubt = 1e-5;
  /// Room for what a message may be answered with, and the events that it causes.
  static constexpr size_t kLongestFrames = 3 * 90;
  static constexpr uint32_t kLineShare[] = {4, 5};

  static constexpr uint32_t kStoreFaults =
      fault::kStoreFull | fault::kStoreNewer | fault::kStoreUnreadable | fault::kStoreOutdated;

  static constexpr StoredBlock kBlocks[] = {kConfiguration, kParameterValues, kLatches};

  /// The message's fields that every request begins with.
  struct Head {
    uint32_t session_id;
    uint16_t request_id;
  };

  static bool is_known(uint8_t parameter) { return parameter >= 1 && parameter <= kParameterCount; }

  /// The code, if that is so.
  static Codes when(bool refused, RefusalCode code) { return refused ? Codes(code) : Codes(); }

  /// Empty: there is none.
  static Codes first_of(std::initializer_list<Codes> reasons) {
    for (const Codes codes : reasons)
      if (!codes.empty()) return codes;
    return {};
  }

  static Head head_of(const Seen& message) {
    Head head{};
    const uint8_t* in = message.body.data();
    wire::get(in, head.session_id);
    wire::get(in, head.request_id);
    return head;
  }

  /// Whether a repeat of the request is carried out again.
  static bool is_answered_afresh(uint8_t id) {
    return id == ConfigurationGet::kId || id == BoxGet::kId || id == BoxRead::kId ||
           id == LedgerGet::kId || id == PeripheralGet::kId || id == HoldGet::kId;
  }

  /// Messages that are sent without further requests once a host has asked for them.
  static bool is_of_sensors(uint8_t id) {
    return id == SensorInfo::kId || id == Imu::kId || id == Power::kId || id == Inputs::kId ||
           id == SensorEvent::kId;
  }

  /// Boards are written as shipped, or broken; boards for other chips are refused.
  static bool can_be_used(const Configuration& configuration) {
    const auto is_same = [&](const BoardDescription& board) {
      return board.chip == kBoardOfEsp32.chip && board == configuration.board;
    };
    return (is_same(sim::kOwnBoard) ||
            std::ranges::any_of(sim::kShippedBoards, is_same, &sim::ShippedBoard::board)) &&
           (!has_levels(configuration.peripherals) || configuration.board.battery >= 0);
  }

  struct Start {
    ConfigurationState state = kDamaged;
    Configuration configuration;
    Candidate candidate_state = Candidate::kNone;
  };
  void read_hello(const Hello& hello) {
    task->answers = true;
    task->codes = hello.protocol_version != schema::kVersion ? kProtocolVersion
                  : hello.schema_hash != schema::kHash       ? kSchema
                                                             : kNone;
    task->is_new = task->codes.has(kNone) &&
                   !(session.open && (hello.nonce ^ simulator_.boot_id()) == session.id);
  }

  template <typename Setpoint>
  void read_setpoint(const Setpoint& message, bool duty, double left, double right) {
    const auto refuse = [this](RefusalCode code) {
      task->answers = true;
      denied = task->codes = code;
      setpoint_us_ = now_us();
    };
    if (!session.open || message.session_id != session.id) return refuse(kNoSession);
    if (message.command_seq <= session.newest_command) {
      // Dropped without an answer, but where no number is left.
      const bool is_spent =
          session.newest_command == UINT32_MAX && message.command_seq != UINT32_MAX;
      if (is_spent) refuse(kCommandSeqSpent);
      return;
    }
    session.newest_command = message.command_seq;
    task->is_new = true;
    // In the device's own resolution: a setpoint below it is zero.
    const auto way_of = [duty](double value) -> uint32_t {
      if (std::abs(value) < (duty ? 1e-9 : 0.5e-6)) return 0;
      return value > 0.0 ? reflex::kNoForward : reflex::kNoReverse;
    };
    const auto ways = static_cast<uint8_t>(way_of(left) | way_of(right));
    task->is_zero = ways == 0;
    const bool may_arm = may_be_gap();
    if (!std::isfinite(left) || !std::isfinite(right)) {
      task->codes = kNotFinite;
      setpoint_us_ = now_us();
    } else {
      task->codes = setpoint_codes(message.expiry_us, ways == 0, ways);
    }
    task->answers = !task->codes.has(kNone);
    if (task->answers) denied = task->codes;
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
  Codes setpoint_codes(uint64_t expiry_us, bool is_zero, uint8_t ways) {
    Codes codes;
    const uint64_t now = now_us();
    if (configuration_state == kBuiltIn) codes |= kBoardUnconfirmed;
    if (configuration_state == kTrial) codes |= kBoardOnTrial;
    if (restarting_) codes |= kBooting;
    if (!session.synchronised) codes |= kClockUnsynchronised;
    const bool is_gap = now >= setpoint_us_ + gap_us();
    const bool perhaps_gap = may_be_gap();
    setpoint_us_ = now;
    if (expiry_us <= now) codes |= kExpired;
    if (trial == Trial::kExpired) codes |= kNoTrial;
    if (task->before == State::kEstopped) codes |= kEstopped;
    if (task->before == State::kFault) codes |= kFault;
    if (contradictions(values_) != 0) codes |= kContradiction;
    if (are_sensors_unread()) codes |= kBooting;
    if ((forbidden() & reflex::kStop) != 0) codes |= kFault;
    const bool rests = unarmed_ && !is_zero;
    if (rests && !perhaps_gap) codes |= kUnarmed;
    // Towards a bumper that is open it is obeyed, and held off.
    const bool is_free = ((forbidden() | perhaps_forbidden()) & ways) == 0;
    if ((held_ways & ways) != 0 && is_free && !perhaps_gap) codes |= kUnarmed;
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
    if ((perhaps_held_ways & ways) != 0) codes |= kUnarmed;
    if (doubtful_contradictions(values_) != 0) codes |= kContradiction;
    if (perhaps_stopped) codes |= kFault;
    return codes;
  }

  uint64_t gap_us() const {
    return static_cast<uint64_t>(static_cast<double>(std::max(value(ParameterId::kRearmGapS),
                                                              value(ParameterId::kTtlMaxS))) *
                                 1e6);
  }

  void read_request(uint32_t session_id, uint16_t request_id) {
    if (!session.open || session_id != session.id) {
      task->answers = true;
      task->codes = kNoSession;
      return;
    }
    if (static_cast<int16_t>(request_id - session.newest_request) <= 0) {
      for (const Kept& kept : session.kept) {
        if (kept.request_id != request_id) continue;
        task->is_repeat = task->answers = true;
        task->exact = kept.answer;
      }
      return;
    }
    task->is_new = task->answers = true;
    if (task->message.id == ParameterTrial::kId) expires_trial();
    task->codes = request_codes(task->message);
    if (task->codes.empty()) task->codes = kNone;
    task->records = !is_answered_afresh(task->message.id) || !task->codes.has(kNone);
  }

  /// The answer to a new message; nullopt: it was lost on the way.
  void remembers(const std::optional<Seen>& answer) {
    if (!task->records && !is_answered_afresh(task->message.id)) return;
    session.newest_request = head_of(task->message).request_id;
    if (task->records) {
      session.kept.push_back({session.newest_request, answer});
      if (session.kept.size() > kKeptAnswers) session.kept.pop_front();
    } else {
      --session.newest_request;  // A repeat of it is a new one.
    }
  }

  /// What outlasts a session cannot change now.
  Codes lasting_code() const {
    return first_of(
        {when(trial == Trial::kRuns, kOnTrial), when(trial == Trial::kExpired, kNoTrial)});
  }

  Codes stopped_code() const { return first_of({lasting_code(), when(drives(), kNotStopped)}); }

  /// Empty: it is carried out.
  Codes request_codes(const Seen& message) const {
    switch (message.id) {
      case ClearEstop::kId:
        return when(contact_open(), kCausePresent);
      case ClearFault::kId:
        return fault_codes();
      case SetStreamRate::kId: {
        const uint32_t rate_hz = message.as<SetStreamRate>().rate_hz;
        const uint32_t capacity = robot_.line.baud() / 10;
        constexpr uint32_t kFrame = WheelState::kSize + 10;
        const bool fits =
            capacity == 0 || rate_hz * kFrame * kLineShare[1] <= capacity * kLineShare[0];
        const bool is_fast = static_cast<float>(rate_hz) > value(ParameterId::kControlRateHz);
        return when(is_fast || !fits, kRateTooHigh);
      }
      case ParameterGet::kId:
        return when(!is_known(message.as<ParameterGet>().parameter), kUnknownParameter);
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
        if (writes || saved_ != kNo) {
          // Formatting is a write to the store, too.
          const bool formats = flash_damaged_ && !robot_.store.failing;
          codes = !formats                             ? save_codes()
                  : robot_.configuration_store.failing ? Codes(kStoreFailed)
                                                       : kNone;
          if (!writes && saved_ == kMaybe) codes |= kNone;
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
        return session.fresh_candidate ? configuration_codes({}) : stopped_code();
      case PeripheralSet::kId:
        return when(message.as<PeripheralSet>().channel >= kMostPeripherals, kOutOfRange);
      case ConfigurationWrite::kId: {
        const auto request = message.as<ConfigurationWrite>();
        Configuration wanted = session.staged;
        wanted.peripherals.count = request.peripheral_count;
        const bool is_meant = request.peripheral_count <= kMostPeripherals &&
                              wanted.fingerprint() == request.fingerprint && can_be_used(wanted);
        const bool on_trial = configuration_state == kTrial;
        return configuration_codes({when(on_trial, kBoardOnTrial), when(!is_meant, kBoardRefused)});
      }
      case ConfigurationConfirm::kId: {
        const bool waits = configuration_state == kTrial || configuration_state == kBuiltIn;
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

  /// Result of saving parameters if nothing else prevents it. The configuration's store records
  /// that there are some, once.
  Codes save_codes() const {
    if (robot_.store.failing || flash_damaged_) return kStoreFailed;
    if (!robot_.configuration_store.failing) return kNone;
    // One that is damaged records nothing before another one is written.
    if (may_be_lost(kConfiguration)) return kNone;
    const Slots::Exists exists = slots_of(kParameterValues).exists;
    return when(exists != kNo, kNone) | when(exists != kYes, kStoreFailed);
  }

  /// `refused`: the reasons against it other than the robot's state.
  Codes configuration_codes(std::initializer_list<Codes> refused) const {
    return first_of({stopped_code(), when(board_confirmed() && estopped(), kEstopped),
                     first_of(refused), when(cannot_write_configuration(), kStoreFailed)});
  }

  /// A fault that a sensor caused lasts as long as it is triggered.
  Codes fault_codes() const {
    if (lasting_ != 0) return kCausePresent;
    if ((simulator_.faults() & fault::kExternal) == 0) return kNone;
    if ((forbidden() & reflex::kStop) != 0 || are_sensors_unread()) return kCausePresent;
    const bool may_last = (perhaps_forbidden() & reflex::kStop) != 0 || battery_.may_be_unread();
    return kNone | when(may_last, kCausePresent);
  }

  // --- sensors ----------------------------------------------------------------------------------

  /// What the triggered sensors of the active list forbid now.
  uint8_t triggered() const {
    if (!board_confirmed()) return 0;
    const sim::Sensors& sensors = robot_.sensors;
    // A pin that the board uses otherwise shows the sensor's input open, which is high.
    const auto is_open = [this](const Peripheral& entry) { return !robot_.is_free(entry.pin_a); };
    uint8_t forbidden = 0;
    for (const Peripheral& entry : peripherals()) {
      const auto place = static_cast<size_t>(entry.place);
      const bool is_front = entry.place == Place::kFrontLeft || entry.place == Place::kFrontRight;
      if (entry.kind == PeripheralKind::kBumper && (sensors.bumpers[place] || is_open(entry)))
        forbidden |= static_cast<uint8_t>(is_front ? reflex::kNoForward : reflex::kNoReverse);
      if (entry.kind == PeripheralKind::kCliff && (sensors.cliffs[place] || is_open(entry)))
        forbidden |= reflex::kStop;
      if (entry.kind == PeripheralKind::kStageFault && sensors.stage_fault && !is_open(entry))
        forbidden |= reflex::kStop;
    }
    return forbidden;
  }

  /// Whether a counter may have counted since the last control step.
  bool may_have_moved() const {
    return std::ranges::any_of(sim::kSides, [this](sim::Side wheel) {
      const sim::Quadrature& encoder = robot_.encoders[wheel];
      return encoder.model.stuck != 0 || encoder.shown_ticks() != seen_ticks_[wheel];
    });
  }

  /// Whether the firmware may believe that a wheel turns.
  bool may_turn() const {
    constexpr uint64_t kMayTurnUs = 650'000;
    return may_have_moved() || now_us() - moved_us_ <= kMayTurnUs;
  }

  Codes codes(const ParameterSet& request) const {
    if (!is_known(request.parameter)) return kUnknownParameter;
    if (!std::isfinite(request.value)) return kNotFinite;
    const ParameterSpec& spec = kParameters[request.parameter - 1];
    if (request.value < spec.minimum || request.value > spec.maximum) return kOutOfRange;
    if (spec.kind != ParameterKind::kReal && request.value != std::floor(request.value))
      return kNotIntegral;
    if (request.value == value(spec.id)) return kNone;
    if (trial == Trial::kExpired) return kNoTrial;
    const bool released = spec.changes == ParameterChanges::kReleased;
    if (released && trial == Trial::kRuns) return kOnTrial;
    const SupervisorState state = contact_open() ? State::kEstopped : simulator_.state();
    const bool drives = state == State::kDriving;
    if ((drives && spec.changes != ParameterChanges::kAlways) ||
        (released && state == State::kEstopped))
      return kNotStopped;
    Codes codes = kNone;
    if (spec.changes != ParameterChanges::kAlways && may_turn()) codes |= kNotStopped;
    Values changed = values_;
    changed[request.parameter - 1U] = request.value;
    const uint32_t known = contradictions(values_);
    if (trial == Trial::kRuns && !drives) return codes;
    if ((contradictions(changed) & ~known) != 0)
      return kContradiction | when(codes.has(kNotStopped), kNotStopped);
    if ((doubtful_contradictions(changed) | doubtful_contradictions(values_)) != 0)
      codes |= kContradiction;
    return codes;
  }

  Codes codes(const ParameterTrial& request) const {
    const bool extends =
        request.action == TrialAction::kBegin || request.action == TrialAction::kRenew;
    if (extends) {
      if (!std::isfinite(request.timeout_s)) return kNotFinite;
      if (request.timeout_s < 0.2f || request.timeout_s > 60.0f) return kOutOfRange;
      if (request.action == TrialAction::kRenew) return trial == Trial::kRuns ? kNone : kNoTrial;
      return first_of({lasting_code(), kNone});
    }
    if (request.action == TrialAction::kRevert) return kNone;
    if (request.action != TrialAction::kKeep) return kOutOfRange;
    if (trial != Trial::kRuns) return kNoTrial;
    const uint32_t fresh = contradictions(values_) & ~contradictions(before_trial_);
    if (fresh != 0) return kContradiction;
    const bool is_doubtful =
        (doubtful_contradictions(values_) | doubtful_contradictions(before_trial_)) != 0;
    return kNone | when(is_doubtful, kContradiction);
  }

  /// The device's own report of what holds it must name everything known to hold it.
  Finding tells(const Hold& hold) const {
    const uint8_t forbids = forbidden();
    const SupervisorState state = simulator_.state();
    const bool on_trial = configuration_state == kTrial;
    const bool unusable = configuration_state == kDamaged;
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
        {state == State::kEstopped, held::kEstop, "ESTOP"},
        {state == State::kFault, held::kFault, "FAULT"},
        {configuration_state == kBuiltIn, held::kConfigurationUnconfirmed,
         "CONFIGURATION_UNCONFIRMED"},
        {on_trial, held::kConfigurationOnTrial, "CONFIGURATION_ON_TRIAL"},
        {unusable, held::kConfigurationUnusable, "CONFIGURATION_UNUSABLE"},
        {contradictions(values_) != 0, held::kContradiction, "CONTRADICTION"},
        {trial == Trial::kExpired, held::kTrialOver, "TRIAL_OVER"},
    };
    for (const auto& one : known)
      if (one.holds && (hold.held & one.flags) == 0)
        return {"hold-is-named"_rule, std::string(one.name) + " holds it, and is not named"};
    if (state != State::kEstopped && (hold.held & held::kEstop) != 0)
      return {"hold-is-named"_rule, "it names an e-stop that is not latched"};
    if (simulator_.faults() == 0 && (hold.held & held::kFault) != 0)
      return {"hold-is-named"_rule, "it names a fault that is not latched"};
    return {};
  }

  /// Checks the answer to the task, and takes note of what it says.
  Finding takes_effect(const Seen& answer) {
    const Seen& message = task->message;
    const auto wrong = [&](const std::string& what) {
      const Rule rule = task->is_repeat ? "request-once"_rule : "answers-as-specified"_rule;
      return Finding{rule,
                     "answered " + describe(message) + " with " + describe(answer) + ": " + what};
    };
    if (message.id == Hello::kId) {
      if (answer.id != DeviceHello::kId) return wrong("a hello is answered with DeviceHello");
      return opens(answer.as<DeviceHello>());
    }
    if (task->is_repeat) {
      if (task->exact && !(*task->exact == answer))
        return wrong("the first time it was " + describe(*task->exact));
      return {};
    }
    if (answer.id == Refuse::kId) {
      const auto refuse = answer.as<Refuse>();
      if (refuse.message_id != message.id) return wrong("it names another message");
      task->refusal = refuse.code;
      if (!task->codes.has(refuse.code)) return wrong("expected " + task->codes.text());
      if (is_setpoint(message.id)) denied = refuse.code;
    } else {
      if (!task->codes.has(kNone)) return wrong("expected " + task->codes.text());
      if (answer.id != answer_to(message.id)) return wrong("another answer belongs to it");
      task->carried_out = true;
    }
    if (task->is_new) remembers(answer);
    const bool failed = task->refusal == kStoreFailed;
    if (message.id == ConfigurationWrite::kId && failed) session.fresh_candidate = false;
    // Only the record of it may have failed.
    const bool is_save = message.id == ParameterSave::kId || message.id == ParameterReset::kId;
    if (is_save && (failed || task->carried_out)) save_failed_ = failed;
    if (is_save && task->carried_out) saved_ = message.id == ParameterReset::kId ? kNo : kYes;
    if (is_save && failed && !robot_.store.failing) {
      flashes_.push_back(flash());
      change_flash(message, flashes_.back());
      Slots::Exists& exists = slots_of(kParameterValues).exists;
      if (exists == kNo) exists = kMaybe;
    }
    // A save that fails for good leaves the values as they are set; so does a reset of them.
    if (message.id == ParameterReset::kId && failed) values_ = defaults();
    if (task->carried_out && (task->is_new || message.id == Ping::kId)) acts(message);
    return {};
  }

  Finding opens(const DeviceHello& hello) {
    if (!task->codes.has(hello.refusal))
      return {"answers-as-specified"_rule,
              "answered Hello with " + name_of(hello.refusal) + ": expected " + task->codes.text()};
    if (!task->is_new) return {};
    task->carried_out = true;
    ends_session();
    session = {.open = true, .id = hello.nonce ^ simulator_.boot_id()};
    setpoint_us_ = now_us();
    return {};
  }

  void ends_session() {
    if (trial == Trial::kRuns) values_ = before_trial_;
    trial = Trial::kNone;
    granted.reset();
  }

  /// A trial whose deadline has passed has ended.
  void expires_trial() {
    if (trial != Trial::kRuns || now_us() < trial_until_us) return;
    ends_session();
    trial = Trial::kExpired;
  }

  /// The message is carried out.
  void acts(const Seen& message) {
    for (Flash& flash : flashes_) change_flash(message, flash);
    switch (message.id) {
      case Stop::kId: {
        const auto stop = message.as<Stop>();
        if (session.open && stop.session_id == session.id)
          session.newest_command = std::max(session.newest_command, stop.command_seq);
        granted.reset();
        return;
      }
      case Estop::kId:
        granted.reset();
        return;
      case Ping::kId:
        session.synchronised = true;
        return;
      case ClearEstop::kId:
      case ClearFault::kId: {
        const SupervisorState latched =
            message.id == ClearEstop::kId ? State::kEstopped : State::kFault;
        if (task->before != latched) return;
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
        flash_damaged_ = false;
        [[fallthrough]];
      case ParameterSave::kId:
        lasting_ &= ~kStoreFaults;
        return;
      case ParameterTrial::kId:
        return acts(message.as<ParameterTrial>());
      case Restart::kId:
        restarting_ = true;
        return;
      case BoardSet::kId:
        session.staged.board = BoardDescription::decode(message.body.data() + message.body.size() -
                                                        BoardDescription::kSize);
        return;
      case PeripheralSet::kId: {
        const uint8_t* const entry = message.body.data() + message.body.size() - Peripheral::kSize;
        session.staged.peripherals.entries[message.as<PeripheralSet>().channel] =
            Peripheral::decode(entry);
        return;
      }
      case ConfigurationWrite::kId:
        session.fresh_candidate = true;
        return;
      case ConfigurationConfirm::kId:
        session.fresh_candidate = false;
        if (configuration_state == kTrial) {
          configuration_state = kStored;
        } else {
          restarting_ = true;
        }
        return;
    }
  }

  void acts(const ParameterTrial& request) {
    const auto until_us = now_us() + static_cast<uint64_t>(request.timeout_s * 1e6f);
    switch (request.action) {
      case TrialAction::kBegin:
        before_trial_ = values_;
        trial = Trial::kRuns;
        [[fallthrough]];
      case TrialAction::kRenew:
        trial_until_us = until_us;
        return;
      case TrialAction::kRevert:
        if (trial == Trial::kRuns) ends_session();
        [[fallthrough]];
      case TrialAction::kKeep:
        trial = Trial::kNone;
        return;
    }
  }

  /// The flash after the message, if all of its writes succeed.
  void change_flash(const Seen& message, Flash& flash) const {
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
        Configuration wanted = session.staged;
        wanted.peripherals.count = message.as<ConfigurationWrite>().peripheral_count;
        flash.candidate = wanted;
        flash.candidate_state = Candidate::kWritten;
        // What cannot be loaded is not written again.
        if (configuration_state == kDamaged) {
          flash.confirmed.reset();
          flash.is_lost = true;
        }
        return;
      }
      case Restart::kId:
        if (session.fresh_candidate) flash.candidate_state = Candidate::kRequested;
        return;
      case ConfigurationConfirm::kId:
        flash.confirmed = configuration_;
        flash.is_lost = false;
        flash.candidate_state = Candidate::kNone;
        return;
    }
  }

  /// The line was full, and the answer is lost.
  void presumes() {
    if (!task->is_new || is_setpoint(task->message.id)) return;
    if (task->message.id == Hello::kId) {
      opens({.nonce = task->message.as<Hello>().nonce, .refusal = kNone});
      return;
    }
    if (!task->codes.is_single()) lost_track = true;
    task->carried_out = task->codes.has(kNone);
    remembers(std::nullopt);
    if (task->carried_out) acts(task->message);
  }

  /// Whether there was a block in slots that hold nothing. One that is recorded, for certain.
  bool may_be_lost(StoredBlock block) const {
    if (!slots_of(block).are_gone()) return false;
    const bool has_configuration = !slots_of(kConfiguration).are_gone();
    if (block != kConfiguration) return has_configuration && slots_of(block).exists != kNo;
    return !slots_of(kParameterValues).are_gone();
  }

  Start boot_of(const Flash& flash) const {
    Start start;
    start.candidate_state = flash.candidate_state;
    // The wiring is unknown.
    if (robot_.configuration_store.unreadable != 0 || robot_.flash.faults != 0 ||
        may_be_lost(kConfiguration))
      return start;
    const bool writable = !robot_.configuration_store.failing;
    if (flash.candidate_state == Candidate::kRequested && writable) {
      start.candidate_state = Candidate::kTried;
      start.state = kTrial;
      start.configuration = *flash.candidate;
      return start;
    }
    if (writable) start.candidate_state = Candidate::kNone;
    if (flash.is_lost) return start;
    if (flash.confirmed) {
      start.state = kStored;
      start.configuration = *flash.confirmed;
    } else {
      start.state = simulator_.board_unwritten ? kBuiltIn : kStored;
      start.configuration =
          simulator_.board_unwritten ? sim::kUnwrittenConfiguration : sim::kOwnConfiguration;
    }
    return start;
  }

  Finding starts_from(const Flash& flash, const std::array<bool, kStoredBlocks>& lost) {
    const auto is_lost = [&lost](StoredBlock block) { return lost[static_cast<size_t>(block)]; };
    const Start start = boot_of(flash);
    configuration_state = start.state;
    configuration_ = start.configuration;
    if (simulator_.configuration_state() != start.state) {
      return {is_lost(kConfiguration)   ? "lost-is-not-empty"_rule
              : start.state == kBuiltIn ? "confirmed-board-only"_rule
                                        : "flash-old-or-new"_rule,
              "the configuration is " + name_of(simulator_.configuration_state()) + " instead of " +
                  name_of(start.state)};
    }
    const bool has_one = start.state != kDamaged;
    if (simulator_.configuration_fingerprint() != (has_one ? configuration_.fingerprint() : 0))
      return {"flash-old-or-new"_rule,
              "it starts with another configuration than the confirmed one"};
    sensors_unread_ = board_confirmed() && peripherals().count != 0;
    forbidden_ = touched_ = 0;
    battery_.start(board_confirmed() ? peripherals() : PeripheralList{});
    flash_damaged_ = robot_.flash.faults != 0;
    values_ = loaded(flash);
    lasting_ = robot_.store.unreadable | robot_.flash.faults;
    // If nothing can be read, this stays undetected.
    if (lasting_ == 0 && is_lost(kParameterValues)) lasting_ = fault::kStoreUnreadable;
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
    const bool is_unreadable = is_lost(kLatches) || robot_.flash.faults != 0;
    const bool estop =
        is_unreadable || (kept_memory ? state_before_reset_ == State::kEstopped : flash.estop);
    const uint32_t faults = lasting_ | (kept_memory ? faults_before_reset_ & ~fault::kNoBoard : 0U);
    unarmed_ = true;
    cleared_ = false;
    const SupervisorState state = estop         ? State::kEstopped
                                  : faults != 0 ? State::kFault
                                                : State::kIdle;
    if (simulator_.state() != state)
      return {is_lost(kLatches) || is_lost(kParameterValues) ? "lost-is-not-empty"_rule
              : kept_memory                                  ? "latch-ends-by-clear"_rule
                                                             : "estop-survives-power-loss"_rule,
              "it starts in " + name_of(simulator_.state()) + " instead of " + name_of(state)};
    if (simulator_.faults() != faults)
      return {is_lost(kParameterValues) ? "lost-is-not-empty"_rule : "latch-ends-by-clear"_rule,
              "it starts with the faults " + std::to_string(simulator_.faults()) + " instead of " +
                  std::to_string(faults)};
    return {};
  }

  /// The values without a saved one.
  Values defaults() const {
    Values values;
    for (size_t i = 0; i < kParameterCount; ++i) values[i] = kParameters[i].default_value;
    if (!board_confirmed()) return values;
    values[index_of(ParameterId::kPwmFrequencyHz)] = board().pwm_frequency_hz;
    values[index_of(ParameterId::kGlitchFilterNs)] = board().encoder_filter_ns;
    if (board().estop < 0) values[index_of(ParameterId::kEstopInputEnabled)] = 0;
    return values;
  }

  /// What a start makes of the flash.
  Values loaded(const Flash& flash) const {
    if (!flash.parameters) return defaults();
    Values values = *flash.parameters;
    if (flash.parameters_board != board_checksum()) {
      const size_t contact = index_of(ParameterId::kEstopInputEnabled);
      values[contact] = defaults()[contact];
    }
    return values;
  }

  uint32_t board_checksum() const { return checksum(board()); }

  // --- contradictions ---------------------------------------------------------------------------

  uint32_t contradictions(const Values& values) const { return contradictions(values, kDoubt); }

  /// Within the rounding of the core's single precision.
  uint32_t doubtful_contradictions(const Values& values) const {
    return contradictions(values, -kDoubt) & ~contradictions(values, kDoubt);
  }

  uint32_t contradictions(const Values& values, double doubt) const {
    const auto of = [&values](ParameterId id) { return static_cast<double>(values[index_of(id)]); };
    using enum ParameterId;
    const double rate_hz = of(kControlRateHz);
    const double turns_hz = of(kMaxVelocityMps) / (2.0 * std::numbers::pi * of(kWheelRadius));
    const double ticks_hz = turns_hz * of(kCountsPerRevolution);
    uint32_t flags = 0;
    if (of(kOverrunLimitUs) < 1.5e6 / rate_hz * (1.0 - doubt))
      flags |= contradiction::kOverrunLimit;
    if (board_confirmed() &&
        of(kPwmFrequencyHz) > kStageTables[static_cast<size_t>(board().stage)].max_frequency_hz)
      flags |= contradiction::kPwmFrequency;
    if (of(kStreamRateHz) > rate_hz) flags |= contradiction::kStreamRate;
    if (of(kSupplyDropV) >= std::min(of(kNominalSupplyV), of(kUnmeasuredSupplyV)))
      flags |= contradiction::kSupplyDrop;
    if (ticks_hz >= rate_hz * (kCounterLimit / 2) * (1.0 + doubt))
      flags |= contradiction::kTickRate;
    if (of(kGlitchFilterNs) * 1e-9 * ticks_hz >= 1.0 + doubt) flags |= contradiction::kGlitchFilter;
    return flags;
  }

  bool may_be_gap() const { return now_us() + 1 >= setpoint_us_ + gap_us(); }

  /// For certain.
  bool are_sensors_unread() const {
    return sensors_unread_ || battery_.is_unread(robot_.battery.millivolts());
  }

  Slots& slots_of(StoredBlock block) { return slots_[static_cast<size_t>(block)]; }
  const Slots& slots_of(StoredBlock block) const { return slots_[static_cast<size_t>(block)]; }

  bool cannot_write_configuration() const {
    return robot_.configuration_store.failing || flash_damaged_;
  }

  bool drives() const { return simulator_.state() == State::kDriving; }

  bool estopped() const { return simulator_.state() == State::kEstopped || contact_open(); }

  uint64_t now_us() const { return robot_.device_us(); }
  sim::Simulator& simulator_;
  sim::SimulatedBoard& robot_;
  std::optional<Granted> wanted_;  ///< What the task asks for.
  bool restarting_ = false;
  bool unarmed_ = true;
  bool cleared_ = false;  ///< Since the start.
  uint64_t setpoint_us_ =
      0;  ///< When the last one arrived, a session opened or a latch was cleared.
  Values values_{};
  Values before_trial_{};
  /// What the flash holds, and what it may hold instead, because a write was cut.
  std::vector<Flash> flashes_{Flash{}};
  /// Parameters, or what cannot be read of them. The values of a save that was cut may be those
  /// that the robot had without it.
  Slots::Exists saved_ = kNo;
  bool save_failed_ = false;  ///< A save since the start failed; part of it may be left.
  uint32_t lasting_ = 0;
  bool flash_damaged_ = false;  ///< Its partition cannot be opened.
  std::array<Slots, kStoredBlocks> slots_;
  uint64_t latch_write_us_ = UINT64_MAX;  ///< The last write of the latches,
  int latch_write_slot_ = 0;              ///< and into which slot.
  int record_writes_ = 0;  ///< Of the configuration, since another block was written.
  Configuration configuration_;
  bool sensors_unread_ = false;  ///< No control step has read them since the start.
  uint8_t forbidden_ = 0;
  BatteryWitness battery_;
  uint64_t touched_us_ = 0;  ///< When one was last triggered, or free again.
  uint8_t touched_ = 0;      ///< What they have forbidden since then.
  std::array<int64_t, 2> seen_ticks_{};
  uint64_t moved_us_ = 0;  ///< When a counter may have counted last.
  SupervisorState state_before_reset_ = State::kBoot;
  uint32_t faults_before_reset_ = 0;
};

}  // namespace wheelwire::explore
