"""ENCODER_IMPLAUSIBLE: an encoder that loses edges trips in time; ordinary driving does not."""

from __future__ import annotations

from contextlib import suppress

import pytest

from support.plausibility import fail, healthy, healthy_in_bursts
from support.virtual import VirtualRobot
from wheelwire.errors import DeviceRefused
from wheelwire_protocol.codes import Fault, SupervisorState

SIDES = ("left", "right")


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("target", [0.1, -0.1, 0.2])
@pytest.mark.parametrize(
    "failure",
    [{"encoder_lost": 0.9}, {"encoder_lost": 0.99}, {"stuck_channel": 1}, {"stuck_channel": 2}],
    ids=str,
)
def test_a_failing_encoder_trips_within_a_second_and_30_cm(
    failure: dict[str, float], target: float, side: str
) -> None:
    outcome = fail(failure, side, target)
    implausible = Fault[f"{side.upper()}_ENCODER_IMPLAUSIBLE"]
    assert outcome.faults in (implausible, Fault[f"{side.upper()}_NOT_COUNTING"])
    assert outcome.seconds <= 1.0
    assert outcome.distance_m <= 0.3


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("driven_s", [0.0, 1.0])
def test_70_percent_lost_trip_at_speed(side: str, driven_s: float) -> None:
    outcome = fail({"encoder_lost": 0.7}, side, 0.3, driven_s)
    assert outcome.faults == Fault[f"{side.upper()}_ENCODER_IMPLAUSIBLE"]
    assert outcome.seconds <= 1.0
    assert outcome.distance_m <= 0.3


def test_70_percent_lost_trip_without_a_measured_battery_too() -> None:
    assert fail({"encoder_lost": 0.7}, "left", 0.3, battery_v=0).faults


def test_and_at_a_lower_speed_where_the_battery_is_measured() -> None:
    assert fail({"encoder_lost": 0.7}, "left", 0.2).faults


def test_the_setpoint_bounds_the_speed_of_what_remains() -> None:
    outcome = fail({"encoder_lost": 0.5}, "left", 0.1)
    assert not outcome.faults
    assert outcome.top_mps < 0.45


def test_duty_setpoints_are_not_judged() -> None:
    robot = VirtualRobot(1, **{"left.encoder_lost": 0.9}).open()
    robot.drive_duty(0.9, 0.9, 2.0)
    assert robot.state() is SupervisorState.DRIVING


def test_duty_setpoints_after_a_velocity_are_not_judged() -> None:
    robot = VirtualRobot(1).open()
    robot.drive(0.2, 0.2, 1.0)
    robot.sim.set("left.encoder_lost", 0.9)
    robot.drive_duty(0.9, 0.9, 2.0)
    assert robot.state() is SupervisorState.DRIVING


def test_a_battery_that_runs_down_is_measured_as_it_is() -> None:
    robot = VirtualRobot(1, supply_v=9.0, battery_v=9.0).open()
    robot.drive(0.38, 0.38, 1.0)
    for name in ("supply_v", "battery_v"):
        robot.sim.set(name, 5.7)
    robot.drive(0.38, 0.38, 3.0)
    assert robot.state() is SupervisorState.DRIVING


@pytest.mark.parametrize("battery_measured", [True, False])
def test_ordinary_driving_is_plausible(battery_measured: bool) -> None:
    assert healthy(60.0, 1, battery_measured) == []


def test_ordinary_starts_and_stops_are_plausible() -> None:
    assert healthy_in_bursts(100.0, 1) == []


@pytest.mark.parametrize("sides", [("left",), ("right",), SIDES])
@pytest.mark.parametrize(("speed", "limit_s"), [(0.3, 1.0), (0.2, 1.0), (-0.3, 1.0), (0.1, 2.0)])
def test_an_encoder_that_loses_its_edges_in_short_gaps_trips(
    speed: float, limit_s: float, sides: tuple[str, ...]
) -> None:
    """14 ms of every 20, which a measured velocity sees as pauses of a wheel that is fast between
    them: it drove at 0.47 m/s instead of 0.3."""
    robot = VirtualRobot(1).open()
    began_us = robot.now_us
    with suppress(DeviceRefused):
        while not robot.sim.get("faults") and robot.now_us < began_us + 4e6:
            robot.set_velocity(speed, speed)
            for lost, seconds in ((1.0, 0.014), (0.0, 0.006)):
                for side in sides:
                    robot.sim.set(f"{side}.encoder_lost", lost)
                robot.run(seconds)
    faults = Fault(int(robot.sim.get("faults")))
    implausible = Fault.LEFT_ENCODER_IMPLAUSIBLE | Fault.RIGHT_ENCODER_IMPLAUSIBLE
    assert faults
    assert faults & ~implausible == 0
    assert (robot.now_us - began_us) / 1e6 <= limit_s
