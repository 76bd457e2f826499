// The simulated robot at a front bumper: whether it stays there, and what happens once it is free.
#include <algorithm>
#include <cmath>

#include "check.hpp"
#include "sim_robot.hpp"

using namespace wheelwire;
using test::SimRobot;
using wheelwire::test::shown;

namespace {

void press(SimRobot& robot, bool pressed) {
  robot.simulator.board.sensors.bumpers[static_cast<size_t>(Place::kFrontLeft)] = pressed;
}

}  // namespace

/// The floor rises ahead: what does not hold the robot lets it roll back.
TEST(a_zero_setpoint_holds_a_robot_at_a_bumper_on_a_slope) {
  for (const bool pressed : {false, true}) {
    SimRobot robot(0.8, 0.15);
    robot.open().drive(0.2f, 0.2f, 1000);
    press(robot, pressed);
    robot.drive(0.0f, 0.0f, 500);
    const double from_m = robot.distance_m();
    double ahead_m = 0.0;
    for (int i = 0; i < 150; ++i) {
      robot.drive(0.0f, 0.0f, 20);
      ahead_m = std::max(ahead_m, robot.distance_m() - from_m);
    }
    CHECK(robot.state() == SupervisorState::kDriving);
    const double back_m = shown(pressed ? "rolls back in 3 s, pressed [m]" : "rolls back, free [m]",
                                from_m - robot.distance_m());
    CHECK(back_m < 0.05);
    CHECK(ahead_m < 0.002);
  }
}

TEST(a_setpoint_towards_a_bumper_holds_the_robot_too) {
  SimRobot robot(0.8, 0.15);
  robot.open().drive(0.2f, 0.2f, 1000);
  press(robot, true);
  const double touched_m = robot.distance_m();
  double ahead_m = 0.0;
  for (int i = 0; i < 150; ++i) {
    robot.drive(0.2f, 0.2f, 20);
    ahead_m = std::max(ahead_m, robot.distance_m() - touched_m);
  }
  CHECK(robot.state() == SupervisorState::kDriving);
  CHECK(shown("rolls back in 3 s [m]", touched_m - robot.distance_m()) < 0.3);
  CHECK(shown("goes on after the touch [m]", ahead_m) < 0.02);
}

TEST(a_robot_does_not_turn_against_a_bumper) {
  SimRobot robot;
  robot.open();
  press(robot, true);
  robot.run_ms(10);
  robot.drive(-0.3001f, 0.3f, 1500);
  CHECK(std::abs(shown("turns in 1.5 s [rad]", robot.simulator.board.plant.pose().heading_rad)) <
        0.02);
}

/// Each time somebody takes the obstacle back a little. The program goes on sending.
TEST(a_robot_hits_an_obstacle_once) {
  SimRobot robot;
  robot.open();
  double wall_m = 0.2;
  int hits = 0;
  int pressed_ms = 0;
  for (int ms = 0; ms < 8000; ++ms) {
    if (ms % 20 == 0) robot.send(robot.velocity(0.2f, 0.2f));
    if (robot.distance_m() >= wall_m && pressed_ms == 0) ++hits;
    pressed_ms = robot.distance_m() >= wall_m ? pressed_ms + 1 : 0;
    if (pressed_ms > 1000) wall_m = robot.distance_m() + 0.05;
    press(robot, robot.distance_m() >= wall_m);
    robot.run_ms(1);
  }
  CHECK(shown("hits in 8 s", hits) == 1.0);
}
