"""Faults: each real one trips with its reason, and ordinary driving trips nothing."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress

import pytest

from support.virtual import VirtualRobot
from wheelwire.errors import DeviceRefused
from wheelwire_protocol.codes import Fault, RefusalCode, SupervisorState
from wheelwire_protocol.types import ClearFault

SIDES = ("left", "right")


def settle(robot: VirtualRobot, left: float, right: float, timeout_s: float = 5.0) -> Fault:
    """Drive until a fault trips or the time is up; returns the faults."""
    end_us = robot.now_us + timeout_s * 1e6
    with suppress(DeviceRefused):
        while robot.now_us < end_us and robot.state() is not SupervisorState.FAULT:
            robot.drive(left, right, 0.02)
    robot.run(0.05)
    return robot.sample.faults


def check_stopped(robot: VirtualRobot) -> None:
    assert robot.state() is SupervisorState.FAULT
    assert not robot.sim.get("drive_on")
    robot.run(2.0)
    assert robot.sim.get("true.left_mps") == 0
    assert robot.sim.get("true.right_mps") == 0


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("speed", [0.1, 0.3, -0.3])
def test_a_dead_encoder_trips_and_stops_both_wheels(side: str, speed: float) -> None:
    robot = VirtualRobot(1, **{f"{side}.encoder_dead": 1}).open()
    assert settle(robot, speed, speed) == Fault[f"{side.upper()}_NOT_COUNTING"]
    check_stopped(robot)


@pytest.mark.parametrize("side", SIDES)
def test_a_setpoint_that_reverses_is_a_first_one_for_a_wheel_that_stands(side: str) -> None:
    robot = VirtualRobot(1, **{f"{side}.motor_open": 1, "supply_v": 11, "battery_v": 11}).open()
    robot.drive(0.05, 0.05, 1.0)
    began_us = robot.now_us
    assert settle(robot, -0.021, -0.021) == Fault[f"{side.upper()}_NOT_COUNTING"]
    assert robot.now_us - began_us < 2_650_000
    check_stopped(robot)


@pytest.mark.parametrize("what", ["encoder_reversed", "motor_reversed"])
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("speed", [0.05, 0.3, -0.3])
def test_a_reversed_wheel_trips_before_it_has_run_far(what: str, side: str, speed: float) -> None:
    robot = VirtualRobot(1, **{f"{side}.{what}": 1}).open()
    assert settle(robot, speed, speed) == Fault[f"{side.upper()}_REVERSED"]
    metres = 2 * math.pi * 0.033 * abs(robot.sim.get(f"true.{side}_ticks")) / 360
    assert metres < 0.15
    check_stopped(robot)


def test_a_fault_is_cleared_and_driving_goes_on() -> None:
    robot = VirtualRobot(1, **{"left.encoder_dead": 1}).open()
    settle(robot, 0.2, 0.2)
    with pytest.raises(DeviceRefused) as refused:
        robot.set_velocity(0.2, 0.2)
    assert refused.value.code == RefusalCode.FAULT
    assert refused.value.faults == Fault.LEFT_NOT_COUNTING
    robot.sim.set("left.encoder_dead", 0)
    robot.request(ClearFault(0, 0))
    robot.run(0.05)
    assert robot.state() is SupervisorState.IDLE
    robot.drive(0.0, 0.0, 0.1)  # a clear alone restarts nothing
    robot.drive(0.2, 0.2, 1.0)
    assert robot.sim.get("true.left_mps") == pytest.approx(0.2, abs=0.02)


# --- what must not trip ------------------------------------------------------------------------


def full_reversals(robot: VirtualRobot) -> None:
    for _ in range(5):
        robot.drive(0.4, 0.4, 0.7)
        robot.drive(-0.4, -0.4, 0.7)


def spins(robot: VirtualRobot) -> None:
    for _ in range(5):
        robot.drive(0.4, -0.4, 0.7)
        robot.drive(-0.4, 0.4, 0.7)


def uphill(robot: VirtualRobot) -> None:
    robot.sim.set("slope_rad", math.radians(12))
    robot.drive(0.2, 0.2, 2.0)
    robot.drive(-0.2, -0.2, 2.0)


def rolling_back_on_a_slope(robot: VirtualRobot) -> None:
    robot.sim.set("slope_rad", math.radians(15))
    for _ in range(3):
        robot.run(1.0)  # coasts, and may roll back
        robot.drive(0.2, 0.2, 1.5)


def wall_touched(robot: VirtualRobot) -> None:
    robot.drive(0.3, 0.3, 1.0)
    robot.sim.set("left.blocked", 1)
    robot.sim.set("right.blocked", 1)
    robot.drive(0.3, 0.3, 0.4)
    robot.sim.set("left.blocked", 0)
    robot.sim.set("right.blocked", 0)
    robot.drive(-0.2, -0.2, 1.0)


def crawling(robot: VirtualRobot) -> None:
    robot.drive(0.02, 0.02, 5.0)
    robot.drive(-0.02, -0.02, 5.0)


def duty_reversals(robot: VirtualRobot) -> None:
    for _ in range(5):
        robot.drive_duty(1.0, 1.0, 0.7)
        robot.drive_duty(-1.0, -1.0, 0.7)


@pytest.mark.parametrize("edge_error", [0.0, 0.3])
@pytest.mark.parametrize(
    "ordinary",
    [
        full_reversals,
        spins,
        uphill,
        rolling_back_on_a_slope,
        wall_touched,
        crawling,
        duty_reversals,
    ],
)
def test_ordinary_driving_trips_nothing(
    robot: VirtualRobot, ordinary: Callable[[VirtualRobot], None], edge_error: float
) -> None:
    for side in SIDES:
        robot.sim.set(f"{side}.encoder_error_ticks", edge_error)
    ordinary(robot)
    assert not any(sample.faults for sample in robot.samples)
    assert robot.state() is SupervisorState.DRIVING
    assert robot.sample.overruns == 0
