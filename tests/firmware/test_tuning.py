"""Drives with other gains than the robot's, in virtual time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import pytest

from support.commissioning import plant_robot
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import CommissioningFailed, InvalidArgument
from wheelwire.samples import WheelSample
from wheelwire.tools.setup.driving import Pair
from wheelwire.tools.tune.before_after import Course, Trace, drive_with_each
from wheelwire.tools.tune.tuning import (
    BOTH,
    RAMP,
    SHAPES,
    SINE,
    STEP,
    Drive,
    compare,
    course_of,
    tracking,
)
from wheelwire_protocol.codes import Fault, SupervisorState

SLUGGISH = {"velocity_feedforward": 0.9, "integral_gain": 4.0}


@pytest.fixture
def robot() -> Iterator[MockDriver]:
    with plant_robot("25ga-1440", raised=False) as robot:
        yield robot


def hold_up(monkeypatch: pytest.MonkeyPatch, robot: MockDriver, *drives: int) -> list[int]:
    """In these drives, counted from 1, the first sample of a moving wheel is read 60 ms late.

    The list is filled with each drive's number.
    """
    read = robot.read
    begun: list[int] = []
    stands = True

    def late(timeout: float = 1.0) -> WheelSample:
        nonlocal stands
        sample = read(timeout)
        moves = abs(sample.left_mps) > 0.03
        if moves and stands:
            begun.append(len(begun) + 1)
            if begun[-1] in drives:
                robot.advance(0.06)
                sample = read(timeout)
        stands = not moves and (stands or sample.state is not SupervisorState.DRIVING)
        return sample

    monkeypatch.setattr(robot, "read", late)
    return begun


def turns(robot: MockDriver) -> tuple[float, float]:
    return robot.simulator.get("true.left_turns"), robot.simulator.get("true.right_turns")


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("speed_mps", [0.05, -0.3])
@pytest.mark.parametrize(("seconds", "distance_m"), [(2.0, 0.5), (3.0, 0.1), (20.0, 2.0)])
def test_a_course_stays_within_its_limits(
    robot: MockDriver, shape: str, speed_mps: float, seconds: float, distance_m: float
) -> None:
    drive = Drive(shape, BOTH, speed_mps, seconds, distance_m)
    try:
        course = course_of(drive, robot)
    except InvalidArgument:
        assert (shape, speed_mps, seconds) in {
            (SINE, -0.3, 2.0),
            (SINE, -0.3, 3.0),
            (STEP, -0.3, 3.0),
        }
        return
    assert course.seconds <= seconds + 1e-9
    step_s = 0.001
    speeds = [course.at(number * step_s).left for number in range(int(course.seconds / step_s) + 2)]
    assert max(map(abs, speeds)) == pytest.approx(abs(speed_mps), rel=0.01)
    assert speeds[-1] == pytest.approx(0.0, abs=1e-9)
    steepest = max(abs(b - a) / step_s for a, b in pairwise(speeds))
    assert steepest <= robot.parameters["max_acceleration_mps2"]
    way_m = furthest_m = 0.0
    for speed in speeds:
        way_m += speed * step_s
        furthest_m = max(furthest_m, abs(way_m))
    assert furthest_m <= distance_m * 1.01
    # As long as one of the limits allows.
    assert furthest_m > 0.95 * distance_m or course.seconds > seconds - 0.01


@pytest.mark.parametrize(
    ("drive", "reason"),
    [
        (Drive(speed_mps=5.0), "beyond the robot's max_velocity_mps, 0.4 m/s"),
        (Drive(speed_mps=0.4, distance_m=0.02), "does not fit into 3 s and 0.02 m"),
        (Drive(speed_mps=0.4, seconds=0.3), "does not fit into 0.3 s"),
        (Drive(RAMP, seconds=0.3), "does not fit"),
        (Drive(SINE, seconds=0.3), "does not fit"),
    ],
)
def test_a_drive_that_cannot_be_moves_nothing(robot: MockDriver, drive: Drive, reason: str) -> None:
    before = turns(robot)
    with pytest.raises(InvalidArgument, match=reason):
        compare(robot, drive, {})
    assert turns(robot) == before


def test_worse_gains_show_in_every_figure(robot: MockDriver) -> None:
    found = compare(robot, Drive(), SLUGGISH)
    assert found.titles == ("before", "after")
    before, after = found.figures
    assert before
    assert after
    for side in ("left", "right"):
        assert before[side].rms_mps < after[side].rms_mps
        rise_s, slower_s = before[side].rise_s, after[side].rise_s
        assert rise_s is not None
        assert slower_s is None or rise_s < slower_s
        assert before[side].settling_s is not None
        assert before[side].overshoot is not None
    assert found.is_worse
    assert found.gain_mps is not None
    assert found.gain_mps < -found.noise_mps
    assert robot.parameters["integral_gain"] == 16.0
    # And the other way round.
    for name, value in SLUGGISH.items():
        robot.parameters.set(name, value)
    back = compare(robot, Drive(), {"velocity_feedforward": 1.365, "integral_gain": 16.0})
    assert not back.is_worse
    assert robot.parameters["integral_gain"] == 4.0


@pytest.mark.parametrize(("wheel", "still"), [("left", 1), ("right", 0)])
def test_one_wheel_is_driven_and_the_other_one_is_held(
    robot: MockDriver, wheel: str, still: int
) -> None:
    before = turns(robot)
    found = compare(robot, Drive(RAMP, wheel, speed_mps=0.1), {})
    moved = [b - a for a, b in zip(before, turns(robot), strict=True)]
    assert abs(moved[still]) < 0.05
    assert moved[1 - still] > 0.2
    assert found.titles == ("before",)
    assert found.figures[0]
    assert list(found.figures[0]) == [wheel]
    assert found.gain_mps is None


def test_a_fault_ends_the_drive_and_is_named(robot: MockDriver) -> None:
    robot.simulator.set("left.blocked", 1)
    found = compare(robot, Drive(seconds=10.0, distance_m=2.0), {})
    assert found.faults == (Fault.LEFT_NOT_COUNTING,)
    assert found.figures == (None,)
    assert found.is_worse
    assert robot.read().state.name == "IDLE"


def test_a_wheel_that_gets_too_far_is_stopped(robot: MockDriver) -> None:
    with pytest.raises(CommissioningFailed, match=r"0\.\d+ m from where it began"):
        compare(robot, Drive(seconds=6.0, distance_m=0.3), {"velocity_feedforward": 20.0})
    assert robot.parameters["velocity_feedforward"] == pytest.approx(1.365)
    assert robot.read().state.name in ("IDLE", "TIMED_OUT")


@pytest.mark.parametrize("late", [1, 2])
def test_a_computer_that_is_held_up_compares_nothing(
    monkeypatch: pytest.MonkeyPatch, robot: MockDriver, late: int
) -> None:
    assert not compare(robot, Drive(), SLUGGISH).held_up
    assert hold_up(monkeypatch, robot, late) == []
    assert compare(robot, Drive(), SLUGGISH).held_up
    # A third drive would take more of the floor than the person was asked for.
    assert not compare(robot, Drive(), {}).held_up


def test_a_delay_at_constant_speed_changes_nothing(
    monkeypatch: pytest.MonkeyPatch, robot: MockDriver
) -> None:
    read = robot.read
    begin_us = None

    def late(timeout: float = 1.0) -> WheelSample:
        nonlocal begin_us
        sample = read(timeout)
        if begin_us is None and sample.left_mps > 0.15:
            begin_us = sample.t_us
        if begin_us is not None and sample.t_us - begin_us in range(500_000, 600_000):
            robot.advance(0.1)
            return read(timeout)
        return sample

    monkeypatch.setattr(robot, "read", late)
    found = compare(robot, Drive(), {})
    assert not found.held_up
    assert found.traces[0]
    assert max(b - a for a, b in pairwise(found.traces[0].times_s)) >= 0.1


@pytest.mark.parametrize(("late", "drives"), [((), 2), ((1,), 3), ((2, 3), 4), ((1, 2, 3, 4), 5)])
def test_setup_repeats_a_drive_in_which_the_computer_was_held_up(
    monkeypatch: pytest.MonkeyPatch, robot: MockDriver, late: tuple[int, ...], drives: int
) -> None:
    course = Course(0.2, [(Pair(0.2, 0.2), 0.1, 0.5), (Pair(0.0, 0.0), 0.1, 0.5)])
    begun = hold_up(monkeypatch, robot, *late)
    sets = {"integral_gain": 16.0}, {"integral_gain": 12.0}
    drive_with_each(robot, sets, course, attempts=3)
    assert len(begun) == drives


def test_the_figures_of_a_step_that_is_known() -> None:
    """A wheel that follows a step by a ramp of 0.2 s, overshoots by a tenth, then settles."""
    drive = Drive(seconds=2.0)
    with plant_robot("25ga-1440", raised=True) as robot:
        course = course_of(drive, robot)
    times = [0.01 * number for number in range(int(course.parts[0].end_s / 0.01))]

    def speed(time_s: float) -> float:
        if time_s < 0.2:
            return time_s / 0.2
        return 1.1 if time_s < 0.5 else 1.0

    measured = tuple(Pair(0.2 * speed(time), 0.0) for time in times)
    commanded = tuple(course.at(time) for time in times)
    figures = tracking(Trace(tuple(times), commanded, measured, 0.0), course, drive, 0)
    assert figures.rise_s == pytest.approx(0.16, abs=0.01)
    assert figures.overshoot == pytest.approx(0.1, abs=0.001)
    assert figures.settling_s == pytest.approx(0.5, abs=0.02)
    ramp = tracking(
        Trace(tuple(times), commanded, measured, 0.0), course, replace(drive, shape=RAMP), 0
    )
    assert (ramp.rise_s, ramp.overshoot, ramp.settling_s) == (None, None, None)
    assert ramp.rms_mps == figures.rms_mps
    never = tuple(Pair(0.1, 0.0) for _ in times)
    slow = tracking(Trace(tuple(times), commanded, never, 0.0), course, drive, 0)
    assert (slow.rise_s, slow.settling_s) == (None, None)
    assert isinstance(course, Course)
