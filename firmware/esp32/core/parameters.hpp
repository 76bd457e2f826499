// The parameters: checked against their bounds, and saved as one block of bytes.
#pragma once

#include "hal.hpp"
#include "protocol.hpp"
#include "wire.hpp"

namespace wheelwire {

constexpr bool ids_count_from_one() {
  for (size_t i = 0; i < kParameterCount; ++i) {
    if (static_cast<size_t>(kParameters[i].id) != i + 1) return false;
  }
  return true;
}
static_assert(ids_count_from_one(), "values are found by id - 1");

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
  RefusalCode check(ParameterId id, float value) const {
    if (!exists(id)) return RefusalCode::kUnknownParameter;
    if (!__builtin_isfinite(value)) return RefusalCode::kNotFinite;
    const ParameterSpec& spec = this->spec(id);
    if (value < spec.minimum || value > spec.maximum) return RefusalCode::kOutOfRange;
    if (spec.kind != ParameterKind::kReal &&
        value != static_cast<float>(static_cast<int32_t>(value)))
      return RefusalCode::kNotIntegral;
    return RefusalCode::kNone;
  }
  /// As `check`; stores the value on kNone.
  RefusalCode set(ParameterId id, float value) {
    const RefusalCode refusal = check(id, value);
    if (refusal == RefusalCode::kNone) values_[static_cast<size_t>(id) - 1] = value;
    return refusal;
  }
  void set_defaults() {
    for (size_t i = 0; i < kParameterCount; ++i) values_[i] = specs_[i].default_value;
  }

  /// Takes the values from the store. A block that is damaged or has a value out of bounds changes
  /// nothing. If another board was active when the e-stop input was switched off,
  /// it has its default: that board had no contact, or a different one.
  Load load(BlockStore& store) {
    uint8_t block[kMaxParameterBlock];
    const size_t size = store.load(block, sizeof block);
    if (size == 0) return store.faults() == 0 ? Load::kEmpty : Load::kDamaged;
    if (size < kHead || size > sizeof block) return Load::kDamaged;
    const uint8_t* in = block;
    const auto magic = wire::take<uint32_t>(in);
    auto count = wire::take<uint8_t>(in);
    if (magic != kListMagic || size != kHead + count * kEntry) return Load::kDamaged;
    if (count == 0) return Load::kEmpty;

    Parameters loaded(specs_, board_);
    uint32_t saved_for = 0;
    for (; count > 0; --count) {
      const auto id = wire::take<ParameterId>(in);
      const auto value = wire::take<uint32_t>(in);
      if (id == kBoardEntry) saved_for = value;
      if (exists(id) && loaded.set(id, __builtin_bit_cast(float, value)) != RefusalCode::kNone)
        return Load::kDamaged;
    }
    if (saved_for != board_) {
      const ParameterSpec& contact = spec(ParameterId::kEstopInputEnabled);
      loaded.set(contact.id, contact.default_value);
    }
    *this = loaded;
    return Load::kLoaded;
  }
  bool save(BlockStore& store) const {
    uint8_t block[kSavedSize];
    uint8_t* out = block;
    wire::put(out, kListMagic);
    wire::put(out, static_cast<uint8_t>(kParameterCount + 1));
    for (const ParameterSpec& spec : kParameters) {
      wire::put(out, spec.id);
      wire::put(out, get(spec.id));
    }
    wire::put(out, kBoardEntry);
    wire::put(out, board_);
    return store.save(block, sizeof block);
  }
  /// Deletes the saved values: the next start has the defaults of its board.
  static bool save_none(BlockStore& store) {
    uint8_t block[kHead];
    uint8_t* out = block;
    wire::put(out, kListMagic);
    wire::put(out, uint8_t{0});
    return store.save(block, sizeof block);
  }
  /// Saves this one. The others keep their stored values, or otherwise their defaults.
  bool save_one(BlockStore& store, ParameterId id) const {
    Parameters stored(specs_, board_);
    // It would overwrite values that were never read.
    if (stored.load(store) == Load::kDamaged) return false;
    stored.values_[static_cast<size_t>(id) - 1] = get(id);
    return stored.save(store);
  }

  /// Which values a start would load otherwise: bit n is the parameter with id n + 1.
  uint64_t unsaved(BlockStore& store) const {
    static_assert(kParameterCount <= 64);
    Parameters stored(specs_, board_);
    stored.load(store);
    uint64_t differing = 0;
    for (size_t i = 0; i < kParameterCount; ++i)
      differing |= static_cast<uint64_t>(values_[i] != stored.values_[i]) << i;
    return differing;
  }

  static bool exists(ParameterId id) {
    const size_t number = static_cast<size_t>(id);
    return number >= 1 && number <= kParameterCount;
  }
  const ParameterSpec& spec(ParameterId id) const { return specs_[static_cast<size_t>(id) - 1]; }

 private:
  // The block: magic, count, (id, value) for each. Keyed by id, so that releases with more and with
  // fewer parameters can read each other's blocks. The last entry has the board's checksum for its
  // value. The store has a checksum.
  static constexpr uint32_t kListMagic = 0x32505757;  // "WWP2"
  static constexpr size_t kHead = 5;
  static constexpr size_t kEntry = 5;
  static constexpr size_t kSavedSize = kHead + (kParameterCount + 1) * kEntry;
  static constexpr auto kBoardEntry = static_cast<ParameterId>(255);
  static_assert(kMaxParameterBlock >= kSavedSize && kParameterCount < 255);

  const ParameterSpec* specs_;
  uint32_t board_;
  float values_[kParameterCount];
};

/// Copies kParameters to `out`, which holds kParameterCount rows, with the defaults of `board`.
inline void platform_specs(Chip board, ParameterSpec* out) {
  for (size_t i = 0; i < kParameterCount; ++i) out[i] = kParameters[i];
  for (const PlatformDefault& row : kPlatformDefaults) {
    if (row.board == board) out[static_cast<size_t>(row.id) - 1].default_value = row.value;
  }
}

}  // namespace wheelwire
