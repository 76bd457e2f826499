// The parameters: checked against their bounds, and saved as one block of bytes.
#pragma once

#include "hal.hpp"
#include "protocol.hpp"

namespace wheelwire {

/// Largest saved block. Has room for a later release with more parameters.
constexpr size_t kMaxParameterBlock = 329;

class Parameters {
 public:
  enum class Load : uint8_t { kLoaded, kEmpty, kDamaged };

  /// `specs`: kParameterCount rows, in the order of the ids; they must outlive this object.
  /// `board`: the checksum of the board that they are for.
  explicit Parameters(const ParameterSpec* specs = kParameters, uint32_t board = 0)
      : specs_(specs), board_(board) {
    set_defaults();
  }

  float get(ParameterId id) const { return values_[static_cast<size_t>(id) - 1]; }
  bool is_on(ParameterId id) const { return get(id) != 0; }

  /// kNone, or why the parameter cannot have this value.
  RefusalCode check(ParameterId id, float value) const;
  /// As `check`; stores the value on kNone.
  RefusalCode set(ParameterId id, float value);
  void set_defaults();

  /// Takes the values from the store. A block that is damaged or has a value out of bounds changes
  /// nothing. If another board was active when the e-stop input was switched off,
  /// it has its default: that board had no contact, or a different one.
  Load load(BlockStore& store);
  bool save(BlockStore& store) const;
  /// Deletes the saved values: the next start has the defaults of its board.
  static bool save_none(BlockStore& store);
  /// Saves this one. The others keep their stored values, or otherwise their defaults.
  bool save_one(BlockStore& store, ParameterId id) const;

  /// Which values a start would load otherwise: bit n is the parameter with id n + 1.
  uint64_t unsaved(BlockStore& store) const;

  static bool exists(ParameterId id);
  const ParameterSpec& spec(ParameterId id) const { return specs_[static_cast<size_t>(id) - 1]; }

 private:
  const ParameterSpec* specs_;
  uint32_t board_;
  float values_[kParameterCount];
};

/// Copies kParameters to `out`, which holds kParameterCount rows, with the defaults of `board`.
void platform_specs(Chip board, ParameterSpec* out);

}  // namespace wheelwire
