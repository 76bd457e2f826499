// The core's state out of a box, and its comparison with that of a re-run; see core/state.hpp.
#pragma once

#include <string.h>

#include <type_traits>

#include "supervisor.hpp"

namespace wheelwire {

/// The words of a state, in their order.
class StateWords {
 public:
  StateWords(const uint32_t* words, size_t count) : at_(words), end_(words + count) {}

  /// All were there, and no more than that.
  bool is_whole() const { return is_good_ && at_ == end_; }

 protected:
  uint32_t take() {
    if (at_ == end_) {
      is_good_ = false;
      return 0;
    }
    return *at_++;
  }
  template <typename T>
  T take_as() {
    if constexpr (std::is_same_v<T, float>) {
      return __builtin_bit_cast(float, take());
    } else {
      uint64_t bits = take();
      if constexpr (sizeof(T) == 8) bits |= static_cast<uint64_t>(take()) << 32;
      if constexpr (std::is_same_v<T, bool>) return bits != 0;
      if constexpr (std::is_same_v<T, SupervisorState>) {
        // The row of a table.
        if (bits >= kStateCount) is_good_ = false;
        bits %= kStateCount;
      }
      return static_cast<T>(bits);
    }
  }

  bool is_good_ = true;

 private:
  const uint32_t* at_;
  const uint32_t* end_;
};

/// Sets each field to what the box says.
class StateReader : public StateWords {
 public:
  using StateWords::StateWords;

  template <typename T>
  void operator()(const char*, T& value) {
    if constexpr (requires { value.visit(*this); }) {
      value.visit(*this);
    } else {
      value = take_as<T>();
    }
  }
  void operator()(const char* name, int32_t& value) {
    value = take_as<int32_t>();
    // The only number by which something is shifted.
    if (strcmp(name, "memory_shift") != 0 || (value > 2 && value < 20)) return;
    is_good_ = false;
    value = 3;
  }
};

/// Finds the first field that is not as the box says.
class StateComparer : public StateWords {
 public:
  using StateWords::StateWords;

  template <typename T>
  void operator()(const char* name, T& value) {
    const size_t outer = length_;
    if (!differs_) enter(name);
    if constexpr (requires { value.visit(*this); }) {
      value.visit(*this);
    } else {
      const T recorded = take_as<T>();
      if (!differs_ && memcmp(&recorded, &value, sizeof value) != 0) {
        differs_ = true;
        recorded_ = static_cast<double>(recorded);
        computed_ = static_cast<double>(value);
      }
    }
    if (!differs_) length_ = outer;
  }

  bool differs() const { return differs_; }
  /// "robot.drive.left.velocity_umps".
  const char* field() const { return path_; }
  double recorded() const { return recorded_; }
  double computed() const { return computed_; }

 private:
  void enter(const char* name) {
    const size_t size = strlen(name);
    const size_t point = length_ == 0 ? 0 : 1;
    if (length_ + point + size >= sizeof path_) return;
    if (point != 0) path_[length_] = '.';
    memcpy(path_ + length_ + point, name, size + 1);
    length_ += point + size;
  }

  char path_[120] = "";
  size_t length_ = 0;
  bool differs_ = false;
  double recorded_ = 0;
  double computed_ = 0;
};

}  // namespace wheelwire
