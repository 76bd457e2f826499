// The simulator's motors and encoders on the chip, so that a bare board is a complete robot. Its EN
// pins stay low.
#pragma once

#include <algorithm>

#include "bridge_port.hpp"
#include "clock.hpp"
#include "counter.hpp"
#include "given_ports.hpp"
#include "parameters.hpp"
#include "plant.hpp"
#include "power_stage.hpp"
#include "quadrature.hpp"

namespace wheelwire {

class SimulatedEncoders final : public EncoderPort {
 public:
  SimulatedEncoders(const sim::Bridge& left, const sim::Bridge& right)
      : left_bridge_(left), right_bridge_(right) {}

  void start(int counts_per_revolution) {
    counts_per_revolution_ = counts_per_revolution;
    last_us_ = now_us();
  }

  /// Runs the plant up to now.
  EncoderCounts latch() override {
    const uint64_t t_us = now_us();
    const double elapsed_s = static_cast<double>(t_us - last_us_) * 1e-6;
    last_us_ = t_us;
    plant_.step(std::min(elapsed_s, kMaxStepS), {left_bridge_.state(), right_bridge_.state()});
    turn(left_, plant_.turned_rad(sim::kLeft));
    turn(right_, plant_.turned_rad(sim::kRight));
    return {.t_us = t_us, .left = left_.counter.value(), .right = right_.counter.value()};
  }

 private:
  /// One physics step per control period, since the chip computes doubles in software. The default
  /// robot's time constant is a hundred times as long. After a longer gap simulated time is lost.
  static constexpr double kMaxStepS = 2e-3;

  struct Wheel {
    explicit Wheel(uint64_t seed) : encoder(seed) {}
    sim::Quadrature encoder;
    sim::PulseCounter counter{encoder.a(), encoder.b()};
  };

  void turn(Wheel& wheel, double angle_rad) {
    wheel.encoder.turn(angle_rad, counts_per_revolution_,
                       [&](bool a, bool b) { wheel.counter.set_levels(a, b); });
  }

  const sim::Bridge& left_bridge_;
  const sim::Bridge& right_bridge_;
  sim::Plant plant_;
  Wheel left_{1};
  Wheel right_{2};
  int counts_per_revolution_ = 0;
  uint64_t last_us_ = 0;
};

struct SimulatedRobot {
  static constexpr uint32_t kCapabilities = capability::kSimulatedPlant;

  explicit SimulatedRobot(const BoardDescription&) {}

  bool start(const Parameters& parameters) {
    encoders.start(static_cast<int>(parameters.get(ParameterId::kCountsPerRevolution)));
    return true;
  }

  sim::Bridge left_bridge;
  sim::Bridge right_bridge;
  PowerStage left_motor{left_bridge};
  PowerStage right_motor{right_bridge};
  SimulatedEncoders encoders{left_bridge, right_bridge};
  GivenContact estop;
};

}  // namespace wheelwire
