// The parameters: bounds checked, kept over a reset in one block of bytes.
#pragma once

#include "hal.hpp"
#include "protocol.hpp"

namespace wheelwire {

/// Bytes of a saved block at most: a later release's, with more parameters, is read too.
constexpr size_t kMaxParameterBlock = 329;

class Parameters {
 public:
  enum class Load : uint8_t { kLoaded, kEmpty, kCorrupt };

  /// `specs`: the kParameterCount rows that this device goes by; they outlive it.
  explicit Parameters(const ParameterSpec* specs = kParameters) : specs_(specs) { set_defaults(); }

  float get(ParameterId id) const { return values_[static_cast<size_t>(id) - 1]; }
  bool is_on(ParameterId id) const { return get(id) != 0; }

  /// kNone, or why the parameter cannot have this value.
  RefusalCode check(ParameterId id, float value) const;
  /// As `check`, and takes the value.
  RefusalCode set(ParameterId id, float value);
  void set_defaults();

  /// Takes what the store holds. A block that is corrupt, foreign or holds a value out of its
  /// bounds changes nothing.
  Load load(ParameterStore& store);
  bool save(ParameterStore& store) const;
  /// Saves this one; of all others the store keeps what it holds, or the defaults.
  bool save_one(ParameterStore& store, ParameterId id) const;

  static bool exists(ParameterId id);
  const ParameterSpec& spec(ParameterId id) const { return specs_[static_cast<size_t>(id) - 1]; }

 private:
  const ParameterSpec* specs_;
  float values_[kParameterCount];
};

/// Copies kParameters to `out`, which holds kParameterCount rows, with the defaults of `board`.
void platform_specs(Board board, ParameterSpec* out);

}  // namespace wheelwire
