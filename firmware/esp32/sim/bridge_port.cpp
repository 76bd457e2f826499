#include "bridge_port.hpp"

namespace wheelwire::sim {

namespace {

constexpr double kFull = kHigh_q15;

double share(int duty_q15) { return std::min(1.0, duty_q15 / kFull); }

/// State of a bridge whose two sides follow these levels.
Winding between(bool a, bool b) {
  return a == b ? Winding::kShorted : a ? Winding::kForward : Winding::kReverse;
}

bool drives(Winding winding) {
  return winding == Winding::kForward || winding == Winding::kReverse;
}

/// The inputs of a stage as its PWMs run. All have one timer: they rise at the start of a period.
class Inputs {
 public:
  Inputs(Stage stage, const StageOutputs& inputs, uint16_t standby_q15)
      : stage_(stage), inputs_(inputs), standby_q15_(standby_q15) {
    for (const uint16_t duty_q15 : inputs.duty_q15) add_edge(duty_q15);
    add_edge(standby_q15);
    std::sort(edges_, edges_ + count_);
    count_ = static_cast<size_t>(std::unique(edges_, edges_ + count_) - edges_);
  }

  /// How many different duties there are between low and high, and each of them, rising.
  size_t edges() const { return count_; }
  uint16_t edge(size_t i) const { return edges_[i]; }

  /// What the winding is connected to at this part of the period.
  Winding at(uint16_t phase_q15) const {
    const auto high = [&](StageInput input) { return inputs_[input] > phase_q15; };
    const bool a = high(StageInput::kIn1);
    const bool b = high(StageInput::kIn2);
    if (standby_q15_ <= phase_q15) return Winding::kOpen;
    switch (stage_) {
      case Stage::kEnableIn1In2:
      case Stage::kHalfBridges:
        return high(StageInput::kEnable) ? between(a, b) : Winding::kOpen;
      case Stage::kPwmIn1In2:
        if (!a && !b) return Winding::kOpen;
        return high(StageInput::kPwm) ? between(a, b) : Winding::kShorted;
      case Stage::kInIn:
        return a || b ? between(a, b) : Winding::kOpen;
      case Stage::kPwmDir:
        if (!high(StageInput::kPwm)) return Winding::kShorted;
        return high(StageInput::kDir) ? Winding::kForward : Winding::kReverse;
    }
    return Winding::kOpen;
  }

 private:
  void add_edge(uint16_t duty_q15) {
    if (duty_q15 != 0 && duty_q15 < kHigh_q15) edges_[count_++] = duty_q15;
  }

  Stage stage_;
  const StageOutputs& inputs_;
  uint16_t standby_q15_;
  size_t count_ = 0;
  uint16_t edges_[kStageInputs + 1];
};

/// `on` is a driving one where there is one.
BridgeState two_parts(Winding on, Winding off, double duty) {
  if (on == off) return {.on = on, .off = on, .duty = 1.0};
  if (!drives(on) && drives(off)) return {.on = off, .off = on, .duty = 1.0 - duty};
  return {.on = on, .off = off, .duty = duty};
}

/// Several PWMs of different duties, as crossed wires between the wheels give: what the winding
/// gets on average.
BridgeState average(const Inputs& inputs) {
  double part[4] = {};
  uint16_t begin = 0;
  for (size_t i = 0; i <= inputs.edges(); ++i) {
    const uint16_t end = i < inputs.edges() ? inputs.edge(i) : uint16_t{kHigh_q15};
    part[static_cast<size_t>(inputs.at(begin))] += share(end - begin);
    begin = end;
  }
  const double forward = part[static_cast<size_t>(Winding::kForward)];
  const double reverse = part[static_cast<size_t>(Winding::kReverse)];
  const double shorted = part[static_cast<size_t>(Winding::kShorted)];
  if (forward == 0.0 && reverse == 0.0)
    return {.on = Winding::kShorted, .off = Winding::kOpen, .duty = shorted};
  const bool closed = shorted > 0.0 || (forward > 0.0 && reverse > 0.0);
  return {.on = forward >= reverse ? Winding::kForward : Winding::kReverse,
          .off = closed ? Winding::kShorted : Winding::kOpen,
          .duty = std::abs(forward - reverse)};
}

}  // namespace

BridgeState state_of(Stage stage, const StageOutputs& inputs, uint16_t standby_q15) {
  const Inputs levels(stage, inputs, standby_q15);
  switch (levels.edges()) {
    case 0:
      return two_parts(levels.at(0), levels.at(0), 1.0);
    case 1:
      return two_parts(levels.at(0), levels.at(levels.edge(0)), share(levels.edge(0)));
    default:
      return average(levels);
  }
}

void Bridge::apply(const StageOutputs& inputs, uint16_t standby_q15) {
  if (inputs == inputs_ && standby_q15 == standby_q15_) return;
  const BridgeState before = state_;
  inputs_ = inputs;
  standby_q15_ = standby_q15;
  state_ = state_of(stage_, inputs_, standby_q15_);
  // While it drove, only the duty may change, or the drive end.
  if (before.drives() && state_.drives() && before.on != state_.on) ++hard_switches_;
}

}  // namespace wheelwire::sim
