#include "bridge_port.hpp"

namespace wheelwire::sim {

namespace {

constexpr double kFull = kHigh_q15;

double share(uint16_t duty_q15) { return std::min(1.0, duty_q15 / kFull); }

/// Of a bridge whose two sides follow these levels.
Winding between(bool a, bool b) {
  return a == b ? Winding::kShorted : a ? Winding::kForward : Winding::kReverse;
}

bool is_high(uint16_t duty_q15) { return duty_q15 == kHigh_q15; }

/// One PWM on `enable`; low, it opens all switches.
BridgeState enabled(uint16_t enable, bool a, bool b) {
  return {.on = between(a, b), .off = Winding::kOpen, .duty = share(enable)};
}

/// One PWM on either input, the other one low or high; `low` is the winding while both are low.
BridgeState by_inputs(uint16_t a, uint16_t b, Winding low) {
  const auto winding = [low](bool a_high, bool b_high) {
    return a_high || b_high ? between(a_high, b_high) : low;
  };
  const bool a_switches = a != 0 && !is_high(a);
  const bool b_switches = b != 0 && !is_high(b);
  const double duty = a_switches ? share(a) : b_switches ? share(b) : 1.0;
  return {.on = winding(a != 0, b != 0),
          .off = winding(!a_switches && a != 0, !b_switches && b != 0),
          .duty = duty};
}

}  // namespace

BridgeState state_of(Stage stage, const StageOutputs& inputs) {
  const uint16_t enable = inputs[StageInput::kEnable];
  const uint16_t in1 = inputs[StageInput::kIn1];
  const uint16_t in2 = inputs[StageInput::kIn2];
  const uint16_t pwm = inputs[StageInput::kPwm];
  switch (stage) {
    case Stage::kEnableIn1In2:
      return enabled(enable, is_high(in1), is_high(in2));
    case Stage::kPwmIn1In2:
      if (in1 == 0 && in2 == 0) return {};
      return {
          .on = between(is_high(in1), is_high(in2)), .off = Winding::kShorted, .duty = share(pwm)};
    case Stage::kInIn:
      return by_inputs(in1, in2, Winding::kOpen);
    case Stage::kHalfBridges:
      return is_high(enable) ? by_inputs(in1, in2, Winding::kShorted) : BridgeState{};
    case Stage::kPwmDir:
      return {.on = is_high(inputs[StageInput::kDir]) ? Winding::kForward : Winding::kReverse,
              .off = Winding::kShorted,
              .duty = share(pwm)};
  }
  return {};
}

void Bridge::set(const StageOutputs& outputs) {
  const BridgeState before = state_;
  inputs_ = outputs;
  state_ = state_of(stage_, inputs_);
  // While it drove, only the duty may change, or the drive end.
  if (before.drives() && state_.drives() && before.on != state_.on) ++hard_switches_;
}

}  // namespace wheelwire::sim
