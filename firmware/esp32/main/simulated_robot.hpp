// The simulator's motors and encoders on the chip, so that a bare board is a complete robot. Its EN
// pins stay low.
#pragma once

#include "bridge_port.hpp"
#include "counter.hpp"
#include "parameters.hpp"
#include "plant.hpp"
#include "power_stage.hpp"
#include "quadrature.hpp"

namespace wheelwire {

class SimulatedEncoders final : public EncoderPort {
 public:
  SimulatedEncoders(const sim::Bridge& left, const sim::Bridge& right)
      : left_bridge_(left), right_bridge_(right) {}

  void start(int counts_per_revolution);

  /// Runs the plant up to now.
  EncoderCounts latch() override;

 private:
  struct Wheel {
    explicit Wheel(uint64_t seed) : encoder(seed) {}
    sim::Quadrature encoder;
    sim::PulseCounter counter{encoder.a(), encoder.b()};
  };

  void turn(Wheel& wheel, double angle_rad);

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

  bool start(const Parameters& parameters);

  struct ClosedContact final : EstopInput {
    bool is_open() override { return false; }
  };

  sim::Bridge left_bridge;
  sim::Bridge right_bridge;
  PowerStage left_motor{left_bridge};
  PowerStage right_motor{right_bridge};
  SimulatedEncoders encoders{left_bridge, right_bridge};
  ClosedContact estop;
};

}  // namespace wheelwire
