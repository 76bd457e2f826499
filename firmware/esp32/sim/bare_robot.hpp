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
  void set_pins(const uint16_t* duty_q15, size_t count) {
    for (size_t gpio = 0; gpio < count; ++gpio) pins_.drive(static_cast<int>(gpio), duty_q15[gpio]);
    wired_.read(pins_);
  }

  bool drives() const { return wired_.drives(); }

  bool brakes() const {
    const auto brakes = [](const Bridge& bridge) { return bridge.state().shorted() >= 1.0; };
    return brakes(wired_.bridges()[kLeft]) || brakes(wired_.bridges()[kRight]);
  }

  /// Lets time pass; returns the edges, in order, until the next call.
  const std::vector<fwsim_edge>& advance_to(Nanoseconds end) {
    edges_.clear();
    while (now_ < end) step(std::min(kStep, end - now_));
    return edges_;
  }

  /// Passes over the time up to `now`: nothing moves in it.
  void skip_to(Nanoseconds now) { now_ = std::max(now_, now); }
  /// From now on both wheels turn at this rate, whatever the motors do.
  void spin(double ticks_per_s) { spin_tps_ = ticks_per_s; }
  Quadrature& encoder(Side side) { return encoders_[side]; }

 private:
  static constexpr auto kStep = static_cast<Nanoseconds>(kMaxPhysicsStep * 1e9);

  void step(Nanoseconds duration) {
    const double dt = static_cast<double>(duration) * 1e-9;
    const auto first = static_cast<std::ptrdiff_t>(edges_.size());
    if (spin_tps_) {
      const double angle_rad = *spin_tps_ * dt * 2.0 * std::numbers::pi / counts_per_revolution_;
      for (const Side side : kSides) turn_encoder(side, angle_rad, duration);
    } else {
      plant_.step(dt, wired_.states());
      for (const Side side : kSides) turn_encoder(side, plant_.turned_rad(side), duration);
    }
    std::stable_sort(edges_.begin() + first, edges_.end(),
                     [](const fwsim_edge& a, const fwsim_edge& b) { return a.t_ns < b.t_ns; });
    now_ += duration;
  }

  /// The wheel turns evenly within a step, and so do its edges come.
  void turn_encoder(Side side, double angle_rad, Nanoseconds duration) {
    Quadrature& encoder = encoders_[side];
    const int gpio_a = board_.pin(kEncoderPins[2 * side]);
    const int gpio_b = board_.pin(kEncoderPins[2 * side + 1]);
    const size_t first = edges_.size();
    bool last_a = encoder.a();
    encoder.turn(angle_rad, counts_per_revolution_, [&](bool a, bool b) {
      const bool is_a = a != last_a;
      last_a = a;
      edges_.push_back({.t_ns = 0,
                        .gpio = static_cast<uint32_t>(is_a ? gpio_a : gpio_b),
                        .level = is_a ? a : b});
    });
    const auto halves = 2 * static_cast<Nanoseconds>(edges_.size() - first);
    for (size_t i = first; i < edges_.size(); ++i)
      edges_[i].t_ns = static_cast<uint64_t>(
          now_ + duration * (2 * static_cast<Nanoseconds>(i - first) + 1) / halves);
  }

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
