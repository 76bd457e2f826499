"""OVERSPEED: a robot that runs away brakes; one that is only fast for a reason does not."""

from __future__ import annotations

from contextlib import suppress

import pytest

from support.virtual import VirtualRobot
from wheelwire.errors import DeviceRefused
from wheelwire_protocol.codes import Fault, StopMode, SupervisorState

SIDES = ("left", "right")
STEEP = {"slope_rad": -0.45, "mass_kg": 3.0}
"""Downhill, so steep that the motors do not hold the robot at full reverse."""


def run_away(robot: VirtualRobot, timeout_s: float = 6.0) -> float:
    """Drive downhill at 0.2 m/s until a fault; returns the seconds until then."""
    began_us = robot.now_us
    with suppress(DeviceRefused):
        while not robot.sim.get("faults") and robot.now_us < began_us + timeout_s * 1e6:
            robot.drive(0.2, 0.2, 0.02)
    return (robot.now_us - began_us) / 1e6


@pytest.mark.parametrize("stop_mode", [StopMode.COAST, StopMode.BRAKE])
def test_a_slope_that_the_motors_do_not_hold_is_braked_until_somebody_drives(
    stop_mode: StopMode,
) -> None:
    robot = VirtualRobot(1).open()
    robot.set_parameter("stop_mode", stop_mode)
    for name, value in STEEP.items():
        robot.sim.set(name, value)
    assert run_away(robot) < 1.5
    assert Fault(int(robot.sim.get("faults"))) == Fault.OVERSPEED
    robot.run(2.0)
    assert robot.state() is SupervisorState.FAULT
    for side in SIDES:
        assert robot.sim.get(f"{side}.shorted") == 1.0


def test_it_is_noticed_across_stops() -> None:
    robot = VirtualRobot(1, **STEEP).open()
    with suppress(DeviceRefused):
        for _ in range(8):
            robot.drive(0.2, 0.2, 0.7)
            robot.stop()
            robot.run(0.3)
    assert Fault(int(robot.sim.get("faults"))) == Fault.OVERSPEED


@pytest.mark.parametrize(
    "settings", [{"slope_rad": -0.2}, {"slope_rad": -0.15, "mass_kg": 3.0}], ids=str
)
def test_a_slope_that_the_motors_hold_is_driven(settings: dict[str, float]) -> None:
    robot = VirtualRobot(1, **settings).open()
    robot.drive(0.2, 0.2, 3.0)
    robot.drive(0.0, 0.0, 2.0)
    assert robot.state() is SupervisorState.DRIVING


def test_a_lowered_limit_is_no_reason() -> None:
    robot = VirtualRobot(1).open()
    robot.set_parameter("max_acceleration_mps2", 0.1)
    robot.drive(0.4, 0.4, 5.0)
    robot.set_parameter("max_velocity_mps", 0.05)
    robot.drive(0.4, 0.4, 5.0)
    assert robot.state() is SupervisorState.DRIVING
    assert robot.sim.get("true.left_mps") == pytest.approx(0.05, abs=0.02)


def test_an_open_loop_is_as_fast_as_its_duty_makes_it() -> None:
    robot = VirtualRobot(1).open()
    robot.set_parameter("max_velocity_mps", 0.1)
    robot.drive_duty(1.0, 1.0, 3.0)
    assert robot.sim.get("true.left_mps") > 0.3
    assert robot.state() is SupervisorState.DRIVING


def test_one_wheel_that_is_lifted_is_no_reason() -> None:
    robot = VirtualRobot(1).open()
    robot.set_parameter("max_velocity_mps", 0.2)
    robot.drive(0.2, 0.2, 1.0)
    began = robot.now_us
    turns = 0.0
    while robot.now_us < began + 3e6:
        turns += 0.045  # 0.47 m/s, by a hand
        robot.sim.set("left.hand_turns", 0.045)
        robot.drive(0.2, 0.2, 0.02)
    assert turns > 1.0
    assert robot.state() is SupervisorState.DRIVING
