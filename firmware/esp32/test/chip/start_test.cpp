// What EN does while the motors are started.
#include "check.hpp"
#include "wired_robot.hpp"

using namespace wheelwire;

namespace wheelwire {
bool Encoders::start(uint32_t) { return true; }
EncoderCounts Encoders::latch() { return {}; }
}  // namespace wheelwire

namespace {

bool was_high(int pin) { return fake_matrix.ever_high.count(pin) != 0; }

}  // namespace

TEST(en_is_never_high_while_the_motors_start) {
  fake_matrix = {};
  WiredRobot robot;
  CHECK(robot.start(Parameters{}));
  CHECK(fake_matrix.pwm_runs);
  CHECK(!was_high(kPins.left.enable) && !was_high(kPins.right.enable));
}

TEST(en_rises_when_a_step_asks_for_drive) {
  fake_matrix = {};
  WiredRobot robot;
  CHECK(robot.start(Parameters{}));
  robot.left_bridge.set_enable(100);
  CHECK(was_high(kPins.left.enable) && !was_high(kPins.right.enable));
}
