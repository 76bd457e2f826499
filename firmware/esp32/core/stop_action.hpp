// What a stop does to the windings of a robot that nothing drives: it coasts, brakes for a time, or
// brakes until it drives again. A stop only ever strengthens the one before it.
#pragma once

#include "protocol.hpp"

namespace wheelwire {

class StopAction {
 public:
  /// A stop in `mode`, which is not kConfigured. It takes effect if it is at least as strong as
  /// what is active, and otherwise only if it `may_weaken`.
  void begin(StopMode mode, bool may_weaken, uint64_t now_us, uint32_t brake_time_us) {
    if (mode < mode_ && !may_weaken) return;
    const uint64_t until_us = now_us + brake_time_us;
    // A stop that brakes as the one before it only brakes for longer.
    if (mode != mode_ || until_us > until_us_) until_us_ = until_us;
    if (mode < mode_) guards_ = false;
    mode_ = mode;
  }
  /// As `begin`, for an e-stop. If it brakes, it brakes until the wheels are still, and again
  /// whenever they turn while the e-stop is latched.
  void begin_estop(StopMode mode, uint64_t now_us, uint32_t brake_time_us) {
    begin(mode, false, now_us, brake_time_us);
    guards_ = guards_ || mode != StopMode::kCoast;
  }
  /// The robot drives.
  void end() { *this = {}; }

  /// Whether the windings are to be shorted. `still`: no wheel has turned recently. `estopped`: an
  /// e-stop is latched.
  bool brakes(uint64_t now_us, bool still, bool estopped) {
    if (mode_ != StopMode::kBrake) return holds();
    if (now_us < until_us_ || (guards_ && !still)) return true;
    if (!guards_ || !estopped) end();
    return false;
  }
  /// Whether it brakes until the robot drives.
  bool holds() const { return mode_ == StopMode::kBrakeUntilDriven; }

 private:
  static_assert(StopMode::kCoast < StopMode::kBrake &&
                StopMode::kBrake < StopMode::kBrakeUntilDriven);

  StopMode mode_ = StopMode::kCoast;
  bool guards_ = false;    // Until the wheels are still.
  uint64_t until_us_ = 0;  // Of kBrake.
};

}  // namespace wheelwire
