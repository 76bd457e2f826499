"""The simulated robot, driven through the firmware: does it move as the page's robot would?"""

from __future__ import annotations

import math

import pytest

from support.virtual import VirtualRobot

NO_LOAD_MPS = 200 * 2 * math.pi / 60 * 0.033


def speeds(robot: VirtualRobot) -> tuple[float, float]:
    return robot.sim.get("true.left_mps"), robot.sim.get("true.right_mps")


def test_full_duty_gives_the_no_load_speed_both_ways(robot: VirtualRobot) -> None:
    robot.drive_duty(1.0, -1.0, 2.0)
    assert speeds(robot) == pytest.approx((NO_LOAD_MPS, -NO_LOAD_MPS), rel=0.02)


def test_pose_follows_the_exact_circle(robot: VirtualRobot) -> None:
    robot.drive(0.3, 0.3, 0.5)
    robot.drive(0.1, 0.3, 2.0)
    left, right = speeds(robot)
    x, y = robot.sim.get("true.x_m"), robot.sim.get("true.y_m")
    heading = robot.sim.get("true.heading_rad")
    radius = 0.1 * (right + left) / (right - left)
    centre = (x - radius * math.sin(heading), y + radius * math.cos(heading))
    robot.drive(0.1, 0.3, 1.0)
    distance = math.hypot(
        robot.sim.get("true.x_m") - centre[0], robot.sim.get("true.y_m") - centre[1]
    )
    assert distance == pytest.approx(radius, rel=0.02)


def test_heading_is_the_difference_of_the_rolled_lengths(robot: VirtualRobot) -> None:
    robot.drive(0.1, 0.3, 3.0)
    per_tick = 2 * math.pi * 0.033 / 360
    ticks = robot.sim.get("true.right_ticks") - robot.sim.get("true.left_ticks")
    assert robot.sim.get("true.heading_rad") == pytest.approx(ticks * per_tick / 0.2, abs=0.01)
