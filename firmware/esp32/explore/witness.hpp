// What somebody knows who sees the bytes on the line, the contact, the power and the clock, but not
// into the firmware: sessions, setpoints that were granted, parameters, boards, latches. It is
// written from protocol/SPEC.md, and calls nothing that the core decides with.
#pragma once

#include <array>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "battery_witness.hpp"
#include "rule_ids.hpp"
#include "simulator.hpp"
#include "wire_decoder.hpp"

namespace wheelwire::explore {

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
  constexpr bool has(RefusalCode code) const {
    return (bits_ >> static_cast<unsigned>(code) & 1) != 0;
  }
  constexpr bool empty() const { return bits_ == 0; }
  constexpr bool is_single() const { return (bits_ & (bits_ - 1)) == 0; }
  std::string text() const;

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

using PackedConfiguration = std::array<uint8_t, Configuration::kSize>;

/// What lies in flash.
struct Flash {
  std::optional<Values> parameters;  ///< None: the defaults.
  uint32_t parameters_board = 0;     ///< Checksum of the board that they were saved for.
  std::optional<PackedConfiguration> confirmed;
  std::optional<PackedConfiguration> candidate;
  Candidate candidate_state = Candidate::kNone;
  bool is_lost = false;  ///< The confirmed configuration was damaged: nothing drives until another
                         ///< is confirmed.
  bool estop = false;

  bool operator==(const Flash&) const = default;
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

enum class Trial { kNone, kRuns, kExpired };

class Witness {
 public:
  explicit Witness(sim::Simulator& simulator) : simulator_(simulator) {}

  // What is seen, in order. Functions that return a finding say what is wrong.
  /// The firmware reads a message, and is about to handle it.
  void reads(const Seen& message);
  Finding sends(const Seen& message);
  /// It has handled the message: it reads on, or its call has ended.
  Finding settles();
  /// A control step has ended. Returns what happened to the battery; nullptr: nothing.
  const char* steps();
  /// Once the robot does not drive, its setpoint does not count any more.
  void notes_stop();
  /// It writes a slot.
  void writes(StoredBlock block, int slot);
  /// The power goes at a write, which is done or not, or has lost what was in the slot.
  void cut_at_write(StoredBlock block, int slot, sim::WriteFate fate);
  /// All stores are formatted.
  void formats();
  /// Time has damaged slots of a block.
  void damages(StoredBlock block, sim::Damage what);
  /// The chip was reset, and begins to boot.
  void resets(bool loses_memory);
  /// It has started.
  Finding starts();
  void drivers_fail() { lasting_ |= fault::kDriverFailed; }

  // What is known.
  bool is_open() const { return open_; }
  uint32_t session_id() const { return session_id_; }
  const std::optional<Granted>& granted() const { return granted_; }
  /// Why the last setpoint that was not granted was not.
  Codes denied() const { return denied_; }
  const Values& values() const { return values_; }
  float value(ParameterId id) const { return values_[index_of(id)]; }
  Trial trial() const { return trial_; }
  uint64_t trial_until_us() const { return trial_until_us_; }
  const std::optional<Task>& task() const { return task_; }
  const Flash& flash() const { return flashes_[0]; }
  ConfigurationState configuration_state() const { return configuration_state_; }
  /// The active one; empty if there is none.
  const Configuration& configuration() const { return configuration_; }
  const BoardDescription& board() const { return configuration_.board; }
  const PeripheralList& peripherals() const { return configuration_.peripherals; }
  bool board_confirmed() const {
    return configuration_state_ == ConfigurationState::kStored ||
           configuration_state_ == ConfigurationState::kTrial;
  }
  /// What the sensors forbid for certain, as flags of `reflex`: they are triggered, and were so
  /// when the firmware last read them.
  uint8_t forbidden() const {
    return forbidden_ | battery_.forbids(simulator_.board.battery.millivolts(), now_us());
  }
  /// What they may forbid: they were triggered a moment ago.
  uint8_t perhaps_forbidden() const {
    return perhaps_forbidden_ |
           battery_.may_forbid(simulator_.board.battery.millivolts(), now_us());
  }
  /// Somebody touched one.
  void notes_touch();
  /// Whether a start, not a clear, was what disarmed it.
  bool unarmed_by_start() const { return unarmed_ && !cleared_; }
  /// Which way a bumper held it off, as flags of `reflex`: it is not to go there until it is armed.
  uint8_t held_ways() const { return held_ways_; }
  /// Which way it may not go.
  uint8_t perhaps_held_ways() const { return perhaps_held_ways_; }
  /// Whether a start found only one of two copies of a block, and the other one is not written yet.
  bool has_lost_copy() const;
  /// Memory that outlives a reset of the processor was not lost before this start.
  bool kept_memory() const { return kept_memory_; }
  SupervisorState last_state() const { return last_state_; }
  uint32_t last_faults() const { return last_faults_; }
  /// State and faults, as they were last seen before the firmware went on.
  void note_state() {
    last_state_ = simulator_.state();
    last_faults_ = simulator_.faults();
  }
  /// It stops the robot, if it counts.
  bool contact_open() const {
    return board_confirmed() && board().estop >= 0 && value(ParameterId::kEstopInputEnabled) != 0 &&
           simulator_.board.estop.is_open();
  }
  bool contradicts() const { return contradictions(values_) != 0; }
  /// An answer was lost, and what became of its request is not known.
  bool lost_track() const { return lost_track_; }
  void forgets_task() { task_.reset(); }

 private:
  struct Kept {
    uint16_t request_id = 0;
    std::optional<Seen> answer;
  };

  template <typename Setpoint>
  void read_setpoint(const Setpoint& message, bool duty, double left, double right);
  void read_hello(const Hello& hello);
  void read_request(uint32_t session_id, uint16_t request_id);
  Codes setpoint_codes(uint64_t expiry_us, bool is_zero, uint8_t ways);
  bool may_be_gap() const { return now_us() + 1 >= setpoint_us_ + gap_us(); }
  uint64_t gap_us() const;
  void remembers(const std::optional<Seen>& answer);
  Codes request_codes(const Seen& message) const;
  Codes codes(const ParameterSet& request) const;
  Codes codes(const ParameterTrial& request) const;
  Codes save_codes() const;
  Codes configuration_codes(std::initializer_list<Codes> refused) const;
  Codes fault_codes() const;
  uint8_t triggered() const;
  /// For certain.
  bool are_sensors_unread() const {
    return sensors_unread_ || battery_.is_unread(simulator_.board.battery.millivolts());
  }
  Codes stopped_code() const;
  /// Whether a counter may have counted since the last control step.
  bool may_have_moved() const;
  /// Whether the firmware may believe that a wheel turns.
  bool may_turn() const;
  Codes lasting_code() const;
  Finding takes_effect(const Seen& answer);
  Finding tells(const Hold& hold) const;
  Finding opens(const DeviceHello& hello);
  void acts(const Seen& message);
  void acts(const ParameterTrial& request);
  void change_flash(const Seen& message, Flash& flash) const;
  void ends_session();
  /// A trial whose deadline has passed has ended.
  void expires_trial();
  struct Start {
    ConfigurationState state = ConfigurationState::kDamaged;
    Configuration configuration;
    Candidate candidate_state = Candidate::kNone;
  };
  Start boot_of(const Flash& flash) const;
  Finding starts_from(const Flash& flash, const std::array<bool, kStoredBlocks>& lost);
  bool may_be_lost(StoredBlock block) const;
  Slots& slots_of(StoredBlock block) { return slots_[static_cast<size_t>(block)]; }
  const Slots& slots_of(StoredBlock block) const { return slots_[static_cast<size_t>(block)]; }
  void presumes();
  Values defaults() const;
  Values loaded(const Flash& flash) const;
  uint32_t board_checksum() const;
  uint32_t contradictions(const Values& values) const;
  uint32_t doubtful_contradictions(const Values& values) const;
  uint32_t contradictions(const Values& values, double margin) const;
  bool cannot_write_configuration() const {
    return simulator_.board.configuration_store.failing || flash_damaged_;
  }
  bool drives() const { return simulator_.state() == SupervisorState::kDriving; }
  bool estopped() const {
    return simulator_.state() == SupervisorState::kEstopped || contact_open();
  }
  uint64_t now_us() const { return simulator_.board.device_us(); }

  sim::Simulator& simulator_;

  bool open_ = false;
  uint32_t nonce_ = 0;
  uint32_t session_id_ = 0;
  bool synchronised_ = false;
  uint32_t newest_command_ = 0;
  uint16_t newest_request_ = 0;
  std::deque<Kept> kept_;
  std::optional<Granted> granted_;
  Codes denied_;
  std::optional<Granted> wanted_;  ///< What the task asks for.
  std::optional<Task> task_;

  bool restarting_ = false;
  bool unarmed_ = true;
  bool cleared_ = false;  ///< Since the start.
  uint64_t setpoint_us_ =
      0;  ///< When the last one arrived, a session opened or a latch was cleared.
  uint8_t held_ways_ = 0;
  uint8_t perhaps_held_ways_ = 0;

  Values values_{};
  Values before_trial_{};
  Trial trial_ = Trial::kNone;
  uint64_t trial_until_us_ = 0;
  /// What the flash holds, and what it may hold instead, because a write was cut.
  std::vector<Flash> flashes_{Flash{}};
  /// Parameters, or what cannot be read of them. The values of a save that was cut may be those
  /// that the robot had without it.
  Slots::Exists saved_ = Slots::Exists::kNo;
  bool save_failed_ = false;  ///< A save since the start failed; part of it may be left.
  uint32_t lasting_ = 0;
  bool flash_damaged_ = false;  ///< Its partition cannot be opened.
  std::array<Slots, kStoredBlocks> slots_;
  uint64_t latch_write_us_ = UINT64_MAX;  ///< The last write of the latches,
  int latch_write_slot_ = 0;              ///< and into which slot.
  int record_writes_ = 0;  ///< Of the configuration, since another block was written.

  ConfigurationState configuration_state_ = ConfigurationState::kDamaged;
  Configuration configuration_;
  bool fresh_candidate_ = false;  ///< Written in this session.
  Configuration staged_;          ///< What was set in this session.
  bool sensors_unread_ = false;   ///< No control step has read them since the start.
  uint8_t forbidden_ = 0;
  uint8_t perhaps_forbidden_ = 0;
  BatteryWitness battery_;
  uint64_t touched_us_ = 0;  ///< When one was last triggered, or free again.
  uint8_t touched_ = 0;      ///< What they have forbidden since then.

  std::array<int64_t, 2> seen_ticks_{};
  uint64_t moved_us_ = 0;  ///< When a counter may have counted last.

  SupervisorState last_state_ = SupervisorState::kBoot;
  uint32_t last_faults_ = 0;
  bool memory_kept_ = false;
  bool kept_memory_ = false;
  SupervisorState state_before_reset_ = SupervisorState::kBoot;
  uint32_t faults_before_reset_ = 0;
  bool lost_track_ = false;
};

}  // namespace wheelwire::explore
