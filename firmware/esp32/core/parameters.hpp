// The parameters: bounds checked, kept over a reset in one block of bytes.
#pragma once

#include "hal.hpp"
#include "protocol.hpp"

namespace wheelwire {

class Parameters {
 public:
  enum class Load : uint8_t { kLoaded, kEmpty, kCorrupt };

  Parameters() { set_defaults(); }

  float get(ParameterId id) const { return values_[static_cast<size_t>(id) - 1]; }
  bool is_on(ParameterId id) const { return get(id) != 0; }

  /// kNone, or why the value was not taken.
  RefusalCode set(ParameterId id, float value);
  void set_defaults();

  /// Takes what the store holds. A block that is corrupt, foreign or holds a value out of its
  /// bounds changes nothing.
  Load load(ParameterStore& store);
  bool save(ParameterStore& store) const;

  static bool exists(ParameterId id);
  static const ParameterSpec& spec(ParameterId id) {
    return kParameters[static_cast<size_t>(id) - 1];
  }

 private:
  float values_[kParameterCount];
};

}  // namespace wheelwire
