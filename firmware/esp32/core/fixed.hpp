// Fixed-point helpers: the RV32 chips have no floating-point unit, so the control loop has no
// floats.
//
// Suffixes: _umps is micrometres per second, _q15 is a fraction of 32767, _qN is scaled by 2^N.
#pragma once

#include <stdint.h>

namespace wheelwire {

constexpr int32_t kFullDuty = 32767;

template <typename T>
constexpr T clamp(T value, T low, T high) {
  return value < low ? low : value > high ? high : value;
}

template <typename T>
constexpr T magnitude(T value) {
  return value < 0 ? -value : value;
}

template <typename T>
constexpr T greater(T a, T b) {
  return a > b ? a : b;
}

/// Of counts that wrap.
constexpr int32_t wrapped_difference(int32_t later, int32_t earlier) {
  return static_cast<int32_t>(static_cast<uint32_t>(later) - static_cast<uint32_t>(earlier));
}

constexpr int32_t sign(int32_t value) { return (value > 0) - (value < 0); }

/// Symmetric, so that negating the result never overflows.
constexpr int32_t saturate32(int64_t value) {
  return static_cast<int32_t>(clamp<int64_t>(value, -INT32_MAX, INT32_MAX));
}

/// a * b / 2^shift, saturated.
constexpr int32_t multiply_shift(int32_t a, int32_t b, int shift) {
  return saturate32((static_cast<int64_t>(a) * b) >> shift);
}

/// a * b / 2^shift where the result is known to fit: takes a third of the instructions.
constexpr int32_t scale(int32_t a, int32_t b, int shift) {
  return static_cast<int32_t>((static_cast<int64_t>(a) * b) >> shift);
}

/// To the nearest integer, halves away from 0, saturated; NaN becomes 0. Works on the bits of the
/// IEEE 754 binary32: without a floating-point unit each comparison or addition is a library call,
/// and value + 0.5f would itself be rounded.
constexpr int32_t to_fixed(float value) {
  const auto bits = __builtin_bit_cast(uint32_t, value);
  const bool negative = bits >> 31 != 0;
  const int exponent = static_cast<int>(bits >> 23 & 0xff) - 127;
  if (exponent < -1) return 0;
  if (exponent > 30) return value != value ? 0 : negative ? -INT32_MAX : INT32_MAX;
  const uint32_t mantissa_q23 = (bits & 0x7fffff) | 0x800000;
  const uint32_t halves =
      exponent < 22 ? mantissa_q23 >> (22 - exponent) : mantissa_q23 << (exponent - 22);
  const auto whole = static_cast<int32_t>((halves + 1) / 2);
  return negative ? -whole : whole;
}

constexpr int32_t to_umps(float mps) { return to_fixed(mps * 1e6f); }
constexpr float to_mps(int32_t umps) { return static_cast<float>(umps) * 1e-6f; }
constexpr int32_t to_q15(float duty) { return to_fixed(duty * kFullDuty); }

}  // namespace wheelwire
