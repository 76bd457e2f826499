// Reads the core's state from a box, and compares it with a re-run's; see core_state.hpp.
#pragma once

#include <string.h>

#include <type_traits>

#include "core_state.hpp"

namespace wheelwire {
namespace {

/// The words of a state, in their order.
class StateWords : public StateVisitor {
 public:
  StateWords(const uint32_t* words, size_t count) : at_(words), end_(words + count) {}

  /// All were there, no more than that, and none that the core cannot have.
  bool is_whole() const { return is_good_ && at_ == end_; }

 protected:
  template <typename T>
  T take() {
    if constexpr (std::is_same_v<T, float>) {
      return __builtin_bit_cast(float, take_word());
    } else {
      uint64_t bits = take_word();
      if constexpr (sizeof(T) == 8) bits |= static_cast<uint64_t>(take_word()) << 32;
      return static_cast<T>(bits);
    }
  }
  void refuse() { is_good_ = false; }

 private:
  uint32_t take_word() {
    if (at_ == end_) {
      refuse();
      return 0;
    }
    return *at_++;
  }

  bool is_good_ = true;
  const uint32_t* at_;
  const uint32_t* end_;
};

/// Sets each field to what the box says, and takes away the parts that it says were not there.
class StateReader : public StateWords {
 public:
  using StateWords::StateWords;

  template <typename... Parts>
  void read(Parts&... parts) {
    (walk(*this, parts), ...);
  }

  // For `walk`.
  template <typename T>
  void number(T& value) {
    value = take<T>();
  }
  /// The row of a table.
  void number(SupervisorState& state) {
    const auto row = take<uint32_t>();
    if (row >= kStateCount) refuse();
    state = static_cast<SupervisorState>(row % kStateCount);
  }
  using StateVisitor::check;
  /// The core shifts by `memory_shift`, so it must be in range.
  void check(ControllerGains& gains) {
    if (gains.memory_shift > 2 && gains.memory_shift < 20) return;
    refuse();
    gains.memory_shift = 3;
  }
  template <typename T>
  void keep(T*& part) {
    if (!take<bool>())
      part = nullptr;
    else if (part == nullptr)
      refuse();
  }
  template <typename T, uint32_t kCapacity>
  uint32_t resize(Ring<T, kCapacity>& ring) {
    ring.clear();
    const auto size = take<uint32_t>();
    if (size > kCapacity) {
      refuse();
      return 0;
    }
    while (ring.size() < size) ring.push() = {};
    return size;
  }
};

/// Finds the first field that is not as the box says.
class StateComparer : public StateWords {
 public:
  using StateWords::StateWords;

  template <typename... Parts>
  void compare(Parts&... parts) {
    (walk(*this, parts), ...);
  }
  bool differs() const { return differs_; }
  /// "drive.left.velocity_umps".
  const char* field() const { return path_; }
  double recorded() const { return recorded_; }
  double computed() const { return computed_; }

  // For `walk`.
  template <auto kMember>
  void enter() {
    if (!differs_) append(name_of<kMember>());
  }
  void leave() {
    if (differs_) return;
    char* const point = strrchr(path_, '.');
    *(point == nullptr ? path_ : point) = '\0';
  }
  template <typename T>
  void number(const T& value) {
    const T recorded = take<T>();
    if (differs_ || memcmp(&recorded, &value, sizeof value) == 0) return;
    differs_ = true;
    recorded_ = static_cast<double>(recorded);
    computed_ = static_cast<double>(value);
  }
  template <typename T>
  void keep(T* part) {
    number(part != nullptr);
  }
  template <typename T, uint32_t kCapacity>
  uint32_t resize(const Ring<T, kCapacity>& ring) {
    number(ring.size());
    return ring.size();
  }

 private:
  struct Name {
    const char* text;
    size_t size;
  };
  /// "velocity_umps" of `&Wheel::velocity_umps_`, as compilers write that.
  template <auto kMember>
  static Name name_of() {
    const char* const text = strrchr(__PRETTY_FUNCTION__, ':') + 1;
    const size_t size = strcspn(text, ";,]");
    return {text, text[size - 1] == '_' ? size - 1 : size};
  }
  void append(Name name) {
    size_t length = strlen(path_);
    if (length + name.size + 2 > sizeof path_) return;
    if (length != 0) path_[length++] = '.';
    memcpy(path_ + length, name.text, name.size);
    path_[length + name.size] = '\0';
  }

  char path_[120] = "";
  bool differs_ = false;
  double recorded_ = 0;
  double computed_ = 0;
};

}  // namespace
}  // namespace wheelwire
