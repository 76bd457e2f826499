// Storage in which saved bytes outlast the simulation. Without one they last as long as it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "uart.hpp"

namespace wheelwire::sim {

class Storage {
 public:
  virtual ~Storage() = default;
  /// Empty if nothing was ever written.
  virtual Bytes read() = 0;
  /// Writes in place: a program that dies in the middle leaves a part, as flash does when the power
  /// fails.
  virtual bool write(size_t offset, const uint8_t* data, size_t size) = 0;
  /// Whenever the program dies, it holds what was there before or these bytes. Empty ones leave it
  /// as if nothing was ever written.
  virtual bool replace(const Bytes& bytes) = 0;
};

}  // namespace wheelwire::sim
