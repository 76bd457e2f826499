// The robot without its device: levels of GPIOs in, edges of its encoders out. Programs that stand
// in for a computer's own pins put it behind them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "chip_pins.hpp"
#include "clock.hpp"
#include "libfwsim.h"
#include "plant.hpp"
#include "quadrature.hpp"
#include "wired_board.hpp"

namespace wheelwire::sim {

class BareRobot {
 public:
  BareRobot(const BoardDescription& board, int counts_per_revolution, Nanoseconds now)
      : board_(board), now_(now), counts_per_revolution_(counts_per_revolution) {}

  /// The duties of the GPIOs from 0 on: 0 is low, kHigh_q15 is high.
  void set_pins(const uint16_t* duty_q15, size_t count);
  bool drives() const;
  bool brakes() const;

  /// Lets time pass; returns the edges, in order, until the next call.
  const std::vector<fwsim_edge>& advance_to(Nanoseconds end);
  /// Passes over the time up to `now`: nothing moves in it.
  void skip_to(Nanoseconds now) { now_ = std::max(now_, now); }

  /// From now on both wheels turn at this rate, whatever the motors do.
  void spin(double ticks_per_s) { spin_tps_ = ticks_per_s; }

  Quadrature& encoder(Side side) { return encoders_[side]; }

 private:
  void step(Nanoseconds duration);
  void turn_encoder(Side side, double angle_rad, Nanoseconds duration);

  BoardDescription board_;
  WiredBoard wired_{board_};
  ChipPins pins_;
  Plant plant_;
  std::array<Quadrature, 2> encoders_{Quadrature(1), Quadrature(2)};
  std::vector<fwsim_edge> edges_;
  Nanoseconds now_;
  int counts_per_revolution_;
  std::optional<double> spin_tps_;
};

}  // namespace wheelwire::sim
