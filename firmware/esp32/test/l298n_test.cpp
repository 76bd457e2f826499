#include "l298n.hpp"

#include "check.hpp"

using namespace wheelwire;

namespace {

/// Records what the pins do, and whether the inputs ever switched while EN was not low.
class Pins final : public BridgePort {
 public:
  void set_inputs(bool a, bool b) override {
    in1 = a;
    in2 = b;
    if (enable != 0) switched_under_current = true;
  }
  void set_enable(uint16_t duty_q15) override { enable = duty_q15; }

  bool in1 = false;
  bool in2 = false;
  uint16_t enable = 0;
  bool switched_under_current = false;
};

}  // namespace

TEST(l298n_truth_table) {
  Pins pins;
  L298n motor(pins);
  motor.drive(1000);
  CHECK(pins.in1 && !pins.in2 && pins.enable == 1000);
  motor.coast();
  CHECK(pins.enable == 0);
  motor.drive(-2000);
  CHECK(!pins.in1 && pins.in2 && pins.enable == 2000);
  motor.coast();
  motor.brake();
  CHECK(pins.in1 == pins.in2 && pins.enable == 32767);
}

TEST(l298n_reverses_through_one_period_of_enable_low) {
  Pins pins;
  L298n motor(pins);
  motor.drive(20'000);
  motor.drive(-20'000);
  CHECK(pins.enable == 0);
  motor.drive(-20'000);
  CHECK(pins.in2 && pins.enable == 20'000);
  motor.brake();
  CHECK(pins.enable == 0);
  motor.brake();
  CHECK(pins.enable == 32767);
  motor.drive(20'000);
  CHECK(pins.enable == 0 && pins.in1 == pins.in2);
  motor.drive(20'000);
  CHECK(pins.in1 && pins.enable == 20'000);
  CHECK(!pins.switched_under_current);
}

TEST(l298n_zero_duty_coasts) {
  Pins pins;
  L298n motor(pins);
  motor.drive(5);
  for (int i = 0; i < 3; ++i) {
    motor.drive(0);
    CHECK(pins.enable == 0);
  }
}
