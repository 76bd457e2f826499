// Numbers on the wire: little-endian and packed, on any machine.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

namespace wheelwire::wire {

template <size_t kSize>
constexpr auto zero_of_size() {
  if constexpr (kSize == 1) return uint8_t{};
  if constexpr (kSize == 2) return uint16_t{};
  if constexpr (kSize == 4) return uint32_t{};
  if constexpr (kSize == 8) return uint64_t{};
}
/// As wide as a number.
template <typename T>
using UnsignedOf = decltype(zero_of_size<sizeof(T)>());

// Shifts by one byte only: on RV32 a 64-bit shift by a variable number of bits is a library call.
template <typename T>
void put(uint8_t*& out, T value) {
  UnsignedOf<T> bits;
  memcpy(&bits, &value, sizeof bits);
  for (size_t i = 0; i < sizeof bits; ++i) {
    *out++ = static_cast<uint8_t>(bits);
    bits = static_cast<decltype(bits)>(bits >> 8);
  }
}

template <typename T>
void get(const uint8_t*& in, T& value) {
  UnsignedOf<T> bits = 0;
  for (size_t i = sizeof bits; i > 0; --i) {
    bits = static_cast<decltype(bits)>(bits << 8 | in[i - 1]);
  }
  memcpy(&value, &bits, sizeof bits);
  in += sizeof bits;
}

/// As `get`; returns the number.
template <typename T>
T take(const uint8_t*& in) {
  T value;
  get(in, value);
  return value;
}

template <size_t kSize>
void put(uint8_t*& out, const char (&text)[kSize]) {
  memcpy(out, text, kSize);
  out += kSize;
}

template <size_t kSize>
void get(const uint8_t*& in, char (&text)[kSize]) {
  memcpy(text, in, kSize);
  in += kSize;
}

}  // namespace wheelwire::wire
