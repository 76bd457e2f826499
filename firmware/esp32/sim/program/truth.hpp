// The robot's true state as lines of JSON: at a rate, and whenever the drive changes.
#pragma once

#include <limits>

#include "console.hpp"
#include "simulator.hpp"

namespace wheelwire::sim {

class TruthStream {
 public:
  /// 0 Hz: none.
  explicit TruthStream(double rate_hz)
      : interval_(rate_hz > 0.0 ? static_cast<Nanoseconds>(1e9 / rate_hz) : 0) {}

  /// Call after every advance.
  void report(const Simulator& simulator, Console& console);
  /// When the next periodic one is due.
  Nanoseconds due() const {
    return interval_ == 0 ? std::numeric_limits<Nanoseconds>::max() : next_;
  }

 private:
  Nanoseconds interval_;
  Nanoseconds next_ = 0;
  uint64_t drive_changes_ = 0;
};

}  // namespace wheelwire::sim
