"""The simulated robot, driven through the firmware: does it move as the page's robot would?"""

from __future__ import annotations

import math

import pytest

from support.virtual import VirtualRobot
from wheelwire_protocol.codes import StopMode

NO_LOAD_MPS = 200 * 2 * math.pi / 60 * 0.033


def speeds(robot: VirtualRobot) -> tuple[float, float]:
    return robot.sim.get("true.left_mps"), robot.sim.get("true.right_mps")


def test_full_duty_gives_the_no_load_speed_both_ways(robot: VirtualRobot) -> None:
    robot.drive_duty(1.0, -1.0, 2.0)
    assert speeds(robot) == pytest.approx((NO_LOAD_MPS, -NO_LOAD_MPS), rel=0.02)


def test_duty_for_the_speed_limit_is_the_pages_share_plus_friction(robot: VirtualRobot) -> None:
    robot.drive(0.4, 0.4, 3.0)
    linear = 0.4 / NO_LOAD_MPS
    assert linear < robot.sim.get("left.duty") < linear + 0.05


def test_no_motion_below_the_dead_band(robot: VirtualRobot) -> None:
    robot.drive_duty(0.05, 0.05, 1.0)
    assert robot.sim.get("drive_on")
    assert robot.sim.get("stands_still")
    robot.drive_duty(0.15, 0.15, 1.0)
    assert not robot.sim.get("stands_still")


def stopping(mode: StopMode) -> tuple[float, float]:
    """Seconds and metres from 0.4 m/s to standstill."""
    robot = VirtualRobot().open()
    robot.set_parameter("brake_time_s", 5.0)
    robot.drive(0.4, 0.4, 2.0)
    begin_m = robot.sim.get("true.distance_m")
    robot.stop(mode)
    robot.run_until(lambda: bool(robot.sim.get("stands_still")))
    time_us = robot.sim.get("standstill_us") - robot.sim.get("drive_removed_us")
    return time_us / 1e6, robot.sim.get("true.distance_m") - begin_m


def test_braking_stops_sooner_than_coasting() -> None:
    brake_s, brake_m = stopping(StopMode.BRAKE)
    coast_s, coast_m = stopping(StopMode.COAST)
    assert 0.1 < brake_s < 0.8 * coast_s < 1.5
    assert 0.02 < brake_m < 0.8 * coast_m


def test_a_standing_robot_stays_exactly_where_it_is() -> None:
    robot = VirtualRobot(slope_rad=0.05).open()
    robot.run(5.0)
    assert robot.sim.get("true.distance_m") == 0.0
    assert robot.sim.get("true.kinetic_energy_j") == 0.0


def test_rolls_back_on_a_slope_that_friction_cannot_hold() -> None:
    robot = VirtualRobot(slope_rad=0.3).open()
    robot.run(1.0)
    assert robot.sim.get("true.x_m") < -0.1


def test_a_slope_costs_speed_uphill_only() -> None:
    final = []
    for slope in (-0.1, 0.0, 0.1):
        robot = VirtualRobot(slope_rad=slope).open()
        robot.drive_duty(0.6, 0.6, 1.5)
        final.append(speeds(robot)[0])
    down, level, up = final
    assert down > 1.05 * level > 1.1 * up


def test_load_slows_one_wheel_and_turns_the_robot() -> None:
    robot = VirtualRobot(**{"left.load_nm": 0.02}).open()
    robot.drive_duty(0.6, 0.6, 1.0)
    left, right = speeds(robot)
    assert left < 0.9 * right
    assert robot.sim.get("true.heading_rad") > 0.1


def test_motors_differ_by_their_scale() -> None:
    robot = VirtualRobot(**{"right.motor_scale": 0.9}).open()
    robot.drive_duty(1.0, 1.0, 2.0)
    left, right = speeds(robot)
    assert right == pytest.approx(0.9 * left, rel=0.01)


def test_a_flat_battery_is_slow() -> None:
    robot = VirtualRobot(supply_v=5.0).open()
    robot.drive_duty(1.0, 1.0, 2.0)
    assert speeds(robot)[0] < 0.65 * NO_LOAD_MPS


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
