"""At any duty limit a wheel that does not do what it is driven to trips; a sound robot does not."""

from __future__ import annotations

from contextlib import suppress
from random import Random

import pytest

from support.duty_limit import (
    FAILURES,
    MAX_DUTIES,
    SUPPLIES_V,
    Failure,
    active_limit,
    detect,
    healthy,
    is_in_time,
    matrix,
)
from support.virtual import VirtualRobot
from wheelwire.errors import DeviceRefused
from wheelwire_protocol.codes import Fault, SupervisorState

SIDES = ("left", "right")


@pytest.mark.parametrize("what", FAILURES)
@pytest.mark.parametrize(
    ("max_duty", "supply_v", "setpoint"),
    [(0.4, 7.4, 0.1), (1.0, 9.0, 0.02), (1.0, 12.0, 0.1), (0.3, 11.1, 0.4), (0.15, 12.6, 0.1)],
)
def test_a_wheel_that_fails_below_the_thresholds_is_noticed(
    what: str, max_duty: float, supply_v: float, setpoint: float
) -> None:
    failure = Failure(what, "left", supply_v, True, max_duty, (setpoint, setpoint))
    assert active_limit(setpoint, max_duty, supply_v) < 0.45
    found = detect(failure)
    assert is_in_time(failure, found), found


def test_so_is_one_on_a_curve_whose_other_wheel_cannot_keep_up() -> None:
    for side in SIDES:
        failure = Failure("encoder_dead", side, 9.0, True, 0.2, (0.05, 0.2))
        found = detect(failure)
        assert is_in_time(failure, found), found


def test_a_sample_of_every_failure_supply_limit_and_setpoint() -> None:
    cases = Random(3).sample(list(matrix()), 120)
    assert {case.supply_v for case in cases} == set(SUPPLIES_V)
    assert {case.max_duty for case in cases} == set(MAX_DUTIES)
    missed = [(case, found) for case in cases if not is_in_time(case, found := detect(case))]
    assert missed == []


def test_a_setpoint_that_varies_hides_no_dead_encoder() -> None:
    robot = VirtualRobot(1, **{"left.encoder_dead": 1}).open()
    robot.set_parameter("max_duty", 0.3)
    with suppress(DeviceRefused):
        for _ in range(20):
            robot.drive(0.08, 0.08, 0.06)
            robot.drive(0.14, 0.14, 0.06)
    assert robot.sim.get("faults") == Fault.LEFT_NOT_COUNTING


def test_sound_robots_at_their_limit_trip_nothing() -> None:
    assert healthy(120.0, 1) == []


@pytest.mark.parametrize("mass_kg", [3.0, 5.0])
@pytest.mark.parametrize("supply_v", [5.5, 7.4, 12.6])
def test_a_heavy_robot_reverses_at_its_limit(mass_kg: float, supply_v: float) -> None:
    robot = VirtualRobot(1, supply_v=supply_v, battery_v=supply_v, mass_kg=mass_kg).open()
    for _ in range(2):
        robot.drive(0.4, 0.4, 1.5)
        robot.drive(-0.4, -0.4, 1.5)
    assert robot.state() is SupervisorState.DRIVING


def test_a_heavy_robot_that_reverses_at_a_wall_trips_nothing() -> None:
    robot = VirtualRobot(1, mass_kg=5.8).open()
    robot.drive(-0.4, -0.2, 2.0)
    robot.sim.set("left.blocked", 1)
    robot.drive(0.02, 0.02, 0.3)
    robot.sim.set("left.blocked", 0)
    robot.drive(0.02, 0.02, 1.0)
    assert robot.state() is SupervisorState.DRIVING


def test_a_saturated_wheel_slows_the_robot_down_on_the_same_curve(robot: VirtualRobot) -> None:
    robot.set_parameter("max_duty", 0.3)
    robot.drive(0.2, 0.4, 1.0)
    before = [robot.sim.get(f"true.{side}_turns") for side in SIDES]
    robot.drive(0.2, 0.4, 3.0)
    left, right = (
        robot.sim.get(f"true.{side}_turns") - start
        for side, start in zip(SIDES, before, strict=True)
    )
    assert left / right == pytest.approx(0.5, abs=0.03)


# --- pushed by hand ------------------------------------------------------------------------------


def push(robot: VirtualRobot, torque_nm: float) -> float:
    """For two seconds at setpoints of zero; returns the left wheel's speed 1.5 s later."""
    robot.drive(0.0, 0.0, 0.3)
    for side in SIDES:
        robot.sim.set(f"{side}.load_nm", torque_nm)
    robot.drive(0.0, 0.0, 2.0)
    for side in SIDES:
        robot.sim.set(f"{side}.load_nm", 0)
    robot.drive(0.0, 0.0, 1.5)
    return robot.sim.get("true.left_mps")


@pytest.mark.parametrize("torque_nm", [0.03, 0.05, -0.05])
@pytest.mark.parametrize("max_duty", [0.15, 0.4, 1.0])
def test_pushing_a_robot_whose_setpoint_is_zero_is_no_fault(
    robot: VirtualRobot, max_duty: float, torque_nm: float
) -> None:
    robot.set_parameter("max_duty", max_duty)
    assert push(robot, torque_nm) == 0
    robot.drive(0.05, 0.05, 1.0)
    assert not robot.sim.get("faults")
    assert robot.sim.get("true.left_mps") == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("torque_nm", [0.15, -0.15])
@pytest.mark.parametrize("max_duty", [0.15, 0.4, 1.0])
def test_pushing_it_much_faster_than_its_limit_is_overspeed(
    robot: VirtualRobot, max_duty: float, torque_nm: float
) -> None:
    robot.set_parameter("max_duty", max_duty)
    with pytest.raises(DeviceRefused, match="OVERSPEED"):
        push(robot, torque_nm)
    assert robot.sim.get("faults") == Fault.OVERSPEED


@pytest.mark.parametrize("what", ["encoder_reversed", "motor_reversed"])
def test_a_reversed_wheel_does_not_run_away_from_a_push(what: str) -> None:
    robot = VirtualRobot(1, **{f"left.{what}": 1}).open()
    assert push(robot, 0.05) == 0
    with suppress(DeviceRefused):
        robot.drive(0.05, 0.05, 1.5)
    assert robot.sim.get("faults") == Fault.LEFT_REVERSED
