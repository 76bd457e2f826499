// Numbers on the wire: little-endian and packed, on any machine.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

namespace wheelwire::wire {

template <size_t kSize>
struct UnsignedOf;
template <>
struct UnsignedOf<1> {
  using Type = uint8_t;
};
template <>
struct UnsignedOf<2> {
  using Type = uint16_t;
};
template <>
struct UnsignedOf<4> {
  using Type = uint32_t;
};
template <>
struct UnsignedOf<8> {
  using Type = uint64_t;
};

// Shifts by one byte only: on RV32 a 64-bit shift by a variable number of bits is a library call.
template <typename T>
void put(uint8_t*& out, T value) {
  typename UnsignedOf<sizeof(T)>::Type bits;
  memcpy(&bits, &value, sizeof bits);
  for (size_t i = 0; i < sizeof bits; ++i) {
    *out++ = static_cast<uint8_t>(bits);
    bits = static_cast<decltype(bits)>(bits >> 8);
  }
}

template <typename T>
void get(const uint8_t*& in, T& value) {
  typename UnsignedOf<sizeof(T)>::Type bits = 0;
  for (size_t i = sizeof bits; i > 0; --i) {
    bits = static_cast<decltype(bits)>(bits << 8 | in[i - 1]);
  }
  memcpy(&value, &bits, sizeof bits);
  in += sizeof bits;
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
