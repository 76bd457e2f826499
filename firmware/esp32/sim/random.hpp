// Seeded randomness, the same on every machine and compiler.
#pragma once

#include <cstdint>

namespace wheelwire::sim {

/// The finaliser of SplitMix64 (Steele, Lea and Flood, 2014): any number to a well-mixed one.
constexpr uint64_t mix(uint64_t value) {
  value += 0x9e3779b97f4a7c15U;
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9U;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebU;
  return value ^ (value >> 31);
}

/// Random bits as a number in [-1, 1).
constexpr double symmetric(uint64_t bits) {
  return static_cast<double>(static_cast<int64_t>(bits)) * 0x1p-63;
}

class Random {
 public:
  explicit Random(uint64_t seed) : state_(mix(seed)) {}

  uint64_t next() { return mix(state_++); }

 private:
  uint64_t state_;
};

}  // namespace wheelwire::sim
