// The owner's description of a robot: the board and its peripherals. Stored as one block, tried
// before it is confirmed.
#pragma once

#include <string.h>

#include "hal.hpp"
#include "peripherals.hpp"

namespace wheelwire {

/// Within this after the start a configuration on trial is confirmed, or the device restarts with
/// the previous one.
constexpr uint64_t kConfigurationTrialUs = 10'000'000;

struct Configuration {
  /// The board, the number of peripherals, their entries, and the checksum, which is the
  /// configuration's fingerprint.
  static constexpr size_t kSize =
      BoardDescription::kSize + 1 + kMostPeripherals * Peripheral::kSize + sizeof(uint32_t);

  BoardDescription board;
  PeripheralList peripherals;

  /// Writes kSize bytes; returns the fingerprint. Entries that do not count are written as those
  /// that are left out.
  uint32_t encode(uint8_t* out) const;
  uint32_t fingerprint() const;
  /// False if the bytes are damaged; `out` is then unchanged.
  static bool decode(const uint8_t* data, size_t size, Configuration& out);
  /// Whether it breaks no rule.
  bool is_usable() const;
};

/// Whether somebody said that this is the robot's board, at least for a trial. Otherwise no pin is
/// driven, and what the board's inputs read means nothing.
constexpr bool is_confirmed(ConfigurationState state) {
  return state == ConfigurationState::kStored || state == ConfigurationState::kTrial;
}

/// Which configuration is active, from one start of the device to the next. A written one is tried
/// once the host restarts the device, and saved only if the host then confirms it; otherwise the
/// previous one returns. Nothing drives on an unconfirmed one.
class ActiveConfiguration {
 public:
  /// How the image's own configuration is used while none is stored.
  enum class BuiltIn : uint8_t { kUnconfirmed, kConfirmed };

  /// `store`: nullptr where a host cannot change it. `chip`: a board for another one is refused.
  /// `built_in`: active while none is stored, or nullptr. A simulated robot really has its built-in
  /// board, so that one is confirmed from the start.
  ActiveConfiguration(BlockStore* store, Chip chip, const Configuration* built_in,
                      BuiltIn confirmation = BuiltIn::kUnconfirmed)
      : store_(store), chip_(chip), built_in_(built_in), confirmation_(confirmation) {}

  /// Decides which one is active. Call it once, before any pin is touched.
  void start();

  ConfigurationState state() const { return state_; }
  bool is_confirmed() const { return wheelwire::is_confirmed(state_); }
  /// Whether a host cannot change it.
  bool is_fixed() const { return store_ == nullptr; }
  bool on_trial() const { return state_ == ConfigurationState::kTrial; }
  /// Why no configuration could be loaded, as flags of `fault`.
  uint32_t faults() const { return faults_; }
  /// Fingerprint of the active one; 0 if there is none.
  uint32_t fingerprint() const { return fingerprint_; }
  /// Meaningless in ConfigurationState::kDamaged.
  const BoardDescription& board() const { return active_.board; }
  /// The peripherals that are read, and whose reflexes act.
  const PeripheralList& peripherals() const { return active_.peripherals; }
  /// Why nothing may drive; kNone if it may.
  RefusalCode refusal() const;
  /// Whether a trial was not confirmed in time.
  bool is_overdue(uint64_t since_start_us) const {
    return on_trial() && since_start_us >= kConfigurationTrialUs;
  }

  // Each returns kNone, or why it was refused. Not for one that is fixed.
  /// Sets the board that the next `write` stores.
  RefusalCode stage_board(const uint8_t* packed) {
    memcpy(staged_, packed, BoardDescription::kSize);
    return RefusalCode::kNone;
  }
  RefusalCode stage_peripheral(size_t channel, const uint8_t* packed);
  /// Stores what was set, with that many peripherals, to be tried if a restart is asked for in this
  /// session.
  RefusalCode write(uint8_t peripheral_count, uint32_t fingerprint);
  /// Saves the one on trial, or the image's own, which drives from the next start on.
  RefusalCode confirm(uint32_t fingerprint);
  /// A restart was asked for: what was written in this session is tried.
  RefusalCode request_trial();

  /// Whether a restart would try another one.
  bool has_candidate() const { return is_fresh_; }
  /// A new session: what the previous one set, or wrote without a restart, is not tried.
  void drop_candidate() {
    is_fresh_ = false;
    memset(staged_, 0, sizeof staged_);
  }

 private:
  /// kWritten: no restart was asked for yet. kRequested: the next start tries it.
  enum class Candidate : uint8_t { kNone, kWritten, kTried, kRequested };

  /// What the store holds, replaced as a whole: so a cut of the power leaves what was before a
  /// write, or what is after it.
  struct Block {
    static constexpr size_t kSize = 2 + 2 * Configuration::kSize;

    Candidate candidate_state = Candidate::kNone;
    bool has_confirmed = false;
    uint8_t confirmed[Configuration::kSize]{};
    uint8_t candidate[Configuration::kSize]{};
  };

  bool load();
  bool save();
  bool take(const uint8_t* packed, ConfigurationState state);
  void take_built_in();

  static constexpr size_t kStagedSize =
      BoardDescription::kSize + 1 + kMostPeripherals * Peripheral::kSize;

  BlockStore* store_;
  Chip chip_;
  ConfigurationState state_ = ConfigurationState::kDamaged;
  bool is_fresh_ = false;  // The candidate was written in this session.
  const Configuration* built_in_;
  BuiltIn confirmation_;
  uint32_t faults_ = 0;
  uint32_t fingerprint_ = 0;
  Configuration active_;
  Block block_;
  uint32_t staged_[(kStagedSize + 3) / 4]{};  // Packed: the board, then the entries.
};

/// The checksum of a board alone: what was saved for another one does not count.
uint32_t checksum(const BoardDescription& board);

/// Makes what the board says the parameters' defaults, in `specs`, kParameterCount rows.
void apply_board(const BoardDescription& board, ParameterSpec* specs);

}  // namespace wheelwire
