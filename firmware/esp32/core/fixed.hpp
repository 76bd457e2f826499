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

constexpr int32_t sign(int32_t value) { return (value > 0) - (value < 0); }

/// Symmetric, so that the sign can always be changed.
constexpr int32_t saturate32(int64_t value) {
  return static_cast<int32_t>(clamp<int64_t>(value, -INT32_MAX, INT32_MAX));
}

/// a * b / 2^shift, saturated.
constexpr int32_t multiply_shift(int32_t a, int32_t b, int shift) {
  return saturate32((static_cast<int64_t>(a) * b) >> shift);
}

/// To the nearest integer, saturated; NaN becomes 0.
constexpr int32_t to_fixed(float value) {
  if (!(value == value)) return 0;
  if (value >= 2147483520.0f) return INT32_MAX;  // the greatest float below 2^31
  if (value <= -2147483520.0f) return -INT32_MAX;
  return static_cast<int32_t>(value < 0 ? value - 0.5f : value + 0.5f);
}

constexpr int32_t to_umps(float mps) { return to_fixed(mps * 1e6f); }
constexpr float to_mps(int32_t umps) { return static_cast<float>(umps) * 1e-6f; }
constexpr int32_t to_q15(float duty) { return to_fixed(duty * kFullDuty); }

}  // namespace wheelwire
