// The order of a control step: faults, then the link, then contact and deadline, then outputs and
// state.
#include "robot_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

TEST(a_setpoint_read_in_the_step_at_which_the_last_one_expires_drives_on) {
  OpenRobot bench;
  bench.send(bench.velocity(0.2f, 0.2f, 20 * RobotBench::kPeriodUs));
  bench.run(19);
  bench.received.clear();
  bench.drive(0.2f, 0.2f, 1);
  CHECK(bench.driven());
  CHECK(bench.count(EventCode::kSupervisor) == 0);
}

TEST(a_state_reports_what_its_own_step_did) {
  OpenRobot bench;
  CHECK(bench.ask<Ack>(SetStreamRate{.rate_hz = 1000}));
  bench.roll(200, 1, -2);
  CHECK(bench.of<WheelState>().back().left_mps > 0.5f);
  CHECK(bench.of<WheelState>().back().right_mps < -1.0f);
  bench.run(600);
  bench.drive(0.2f, 0.2f);
  bench.received.clear();
  bench.contact.open = true;
  bench.step();
  const std::vector<WheelState> states = bench.of<WheelState>();
  CHECK(states.size() == 1);
  CHECK(states.back().supervisor == SupervisorState::kEstopped);
  CHECK(states.back().left_duty_q15 == 0);
}

TEST(a_line_that_hangs_up_stops_the_wheels_and_is_told_nothing_more) {
  DrivingRobot bench;
  bench.received.clear();
  bench.device.hang_up(bench.now_us);
  CHECK(!bench.driven() && bench.device.deadline_us() == 0);
  bench.run(100);
  CHECK(!bench.device.has_session());
  CHECK(bench.state() == SupervisorState::kIdle);
  CHECK(bench.received.empty());
}
