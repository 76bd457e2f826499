#include "bare_robot.hpp"

namespace wheelwire::sim {

namespace {

constexpr auto kStep = static_cast<Nanoseconds>(kMaxPhysicsStep * 1e9);

}  // namespace

void BareRobot::set_pins(const uint16_t* duty_q15, size_t count) {
  for (size_t gpio = 0; gpio < count; ++gpio) pins_.drive(static_cast<int>(gpio), duty_q15[gpio]);
  wired_.read(pins_);
}

bool BareRobot::drives() const {
  return wired_.bridges()[kLeft].state().drives() || wired_.bridges()[kRight].state().drives();
}

bool BareRobot::brakes() const {
  const auto brakes = [](const Bridge& bridge) { return bridge.state().shorted() >= 1.0; };
  return brakes(wired_.bridges()[kLeft]) || brakes(wired_.bridges()[kRight]);
}

const std::vector<fwsim_edge>& BareRobot::advance_to(Nanoseconds end) {
  edges_.clear();
  while (now_ < end) step(std::min(kStep, end - now_));
  return edges_;
}

void BareRobot::step(Nanoseconds duration) {
  const double dt = static_cast<double>(duration) * 1e-9;
  const auto first = static_cast<std::ptrdiff_t>(edges_.size());
  if (spin_tps_) {
    const double angle_rad = *spin_tps_ * dt * 2.0 * std::numbers::pi / counts_per_revolution_;
    for (const Side side : kSides) turn_encoder(side, angle_rad, duration);
  } else {
    plant_.step(dt, {wired_.bridges()[kLeft].state(), wired_.bridges()[kRight].state()});
    for (const Side side : kSides) turn_encoder(side, plant_.turned_rad(side), duration);
  }
  std::stable_sort(edges_.begin() + first, edges_.end(),
                   [](const fwsim_edge& a, const fwsim_edge& b) { return a.t_ns < b.t_ns; });
  now_ += duration;
}

/// The wheel turns evenly within a step, and so do its edges come.
void BareRobot::turn_encoder(Side side, double angle_rad, Nanoseconds duration) {
  Quadrature& encoder = encoders_[side];
  const int gpio_a = board_.pin(kEncoderPins[2 * side]);
  const int gpio_b = board_.pin(kEncoderPins[2 * side + 1]);
  const size_t first = edges_.size();
  bool last_a = encoder.a();
  encoder.turn(angle_rad, counts_per_revolution_, [&](bool a, bool b) {
    const bool is_a = a != last_a;
    last_a = a;
    edges_.push_back(
        {.t_ns = 0, .gpio = static_cast<uint32_t>(is_a ? gpio_a : gpio_b), .level = is_a ? a : b});
  });
  const auto halves = 2 * static_cast<Nanoseconds>(edges_.size() - first);
  for (size_t i = first; i < edges_.size(); ++i)
    edges_[i].t_ns = static_cast<uint64_t>(
        now_ + duration * (2 * static_cast<Nanoseconds>(i - first) + 1) / halves);
}

}  // namespace wheelwire::sim
