// A stop holds, whatever came before: how far and how fast the simulated robot still rolls.
#include <cmath>

#include "check.hpp"
#include "sim_robot.hpp"

using namespace wheelwire;
using test::SimRobot;
using wheelwire::test::shown;

namespace {

constexpr double kDownhill = -0.15;

/// How far it rolls until it stands, at most for some seconds.
double rolls_out_m(SimRobot& robot, int seconds = 10) {
  const double from_m = robot.distance_m();
  for (int i = 0; i < seconds * 100 && !robot.simulator.board.plant.stands_still(); ++i)
    robot.run_ms(10);
  return robot.distance_m() - from_m;
}

}  // namespace

TEST(an_estop_20_ms_after_a_coasting_stop_brakes) {
  SimRobot robot(3.0);
  robot.open().drive(0.4f, 0.4f, 2000);
  robot.send(robot.stop(StopMode::kCoast));
  robot.run_ms(20);
  robot.send(Estop{});
  CHECK(shown("rolls on after the e-stop [m]", rolls_out_m(robot)) < 0.32);
}

TEST(a_contact_that_opens_3_s_after_a_stop_brakes_on_a_slope) {
  SimRobot robot(0.8, kDownhill);
  robot.open().drive(0.3f, 0.3f, 1000);
  robot.send(robot.stop());
  robot.run_ms(3000);
  const double before = shown("rolls at [m/s]", robot.speed_mps());
  robot.simulator.board.estop.open = true;
  robot.run_ms(2000);
  CHECK(shown("2 s after the contact opened [m/s]", robot.speed_mps()) < 0.5 * before);
}

TEST(a_stop_brakes_in_idle_too) {
  SimRobot robot(0.8, kDownhill);
  robot.open().run_ms(1000);
  const double before = shown("rolls at [m/s]", robot.speed_mps());
  robot.send(robot.stop(StopMode::kBrake));
  robot.run_ms(500);
  CHECK(shown("half a second after Stop(BRAKE) [m/s]", robot.speed_mps()) < 0.7 * before);
}

TEST(an_estop_brakes_whatever_stop_mode_says) {
  SimRobot robot(3.0);
  robot.open().set(ParameterId::kStopMode, 1);
  robot.drive(0.4f, 0.4f, 2000);
  robot.send(Estop{});
  CHECK(shown("rolls on after the e-stop [m]", rolls_out_m(robot)) < 0.32);
}

TEST(an_estopped_robot_that_begins_to_roll_brakes_again) {
  SimRobot robot;
  robot.open().drive(0.2f, 0.2f, 1000);
  robot.send(Estop{});
  robot.run_ms(4000);
  CHECK(!robot.brakes());
  robot.tilt(kDownhill);
  robot.run_ms(3000);
  CHECK(shown("3 s after the floor was tilted [m/s]", robot.speed_mps()) < 0.35);
  CHECK(robot.brakes());
}

TEST(a_brake_until_driven_outlives_a_panic) {
  SimRobot robot(0.8, 0.0);
  robot.open().set(ParameterId::kStopMode, 3);
  robot.tilt(kDownhill);
  robot.drive(0.3f, 0.3f, 1000);
  robot.send(robot.stop());
  robot.run_ms(2000);
  const double before = shown("on its brake [m/s]", robot.speed_mps());
  robot.simulator.reset(ResetReason::kPanic);
  robot.run_ms(2000);
  CHECK(shown("2 s after the panic [m/s]", robot.speed_mps()) < before + 0.02);
  CHECK(robot.brakes());
}

TEST(a_strangers_stop_does_not_make_the_sessions_weaker) {
  SimRobot robot(3.0);
  robot.open().drive(0.4f, 0.4f, 2000);
  Stop stop = robot.stop(StopMode::kCoast);
  stop.session_id ^= 1;
  robot.send(stop);
  CHECK(shown("rolls on after a stranger's Stop(COAST) [m]", rolls_out_m(robot)) < 0.32);
}
