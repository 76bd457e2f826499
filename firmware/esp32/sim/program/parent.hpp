// The process that this one was started for.
#pragma once

#include "descriptor.hpp"

namespace wheelwire::sim {

class Parent {
 public:
  /// -1: none. Throws std::runtime_error when it has ended already.
  explicit Parent(int pid);

  /// Becomes readable when it ends; -1 where the system does not support that.
  int descriptor() const { return descriptor_.get(); }
  bool ended() const;

 private:
  Descriptor descriptor_;
};

}  // namespace wheelwire::sim
