"""A program that asks too seldom, or not for a moment, is not a computer that stood still."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from support.cases import each
from support.staged_stops import StagedRobot, judged
from wheelwire.link.traffic import Kind, Record
from wheelwire.log.why.causes import CAUSES
from wheelwire.log.why.diagnosis import Stop
from wheelwire.log.why.history import History
from wheelwire_protocol.codes import Fault


def stops_of(play: Callable[[StagedRobot], object], seed: int = 1) -> list[Stop]:
    robot = StagedRobot(seed)
    robot.open()
    robot.run(0.3)
    play(robot)
    robot.run(0.8)
    return judged(robot)


def loop(robot: StagedRobot, cycles: int, period_s: float, ttl_s: float) -> None:
    for _ in range(cycles):
        robot.set_velocity(0.2, 0.2, ttl_s)
        robot.run(period_s)


def test_a_ttl_below_the_loops_period_is_one_entry() -> None:
    (stop,) = stops_of(lambda robot: loop(robot, 60, 0.13, 0.07))
    assert stop.cause == "ttl_too_short"
    assert stop.evidence == ("setpoints every 0.13 s, ttl 0.07 s",)


def test_it_is_reported_again_after_a_while_in_which_it_was_in_time() -> None:
    def play(robot: StagedRobot) -> None:
        for _ in range(2):
            loop(robot, 20, 0.13, 0.07)
            loop(robot, 80, 0.1, 0.3)

    assert [stop.cause for stop in stops_of(play)] == ["ttl_too_short"] * 2 + ["program_paused"]


@pytest.mark.parametrize("seed", range(1, 4))
@each("pause_s", [0.32, 0.4, 0.7])
def test_a_moment_without_setpoints_is_a_pause(seed: int, pause_s: float) -> None:
    def play(robot: StagedRobot) -> None:
        robot.drive(0.2, 0.2, 1.0)
        robot.run(pause_s)
        robot.drive(0.2, 0.2, 0.5)
        robot.stop()

    causes = [stop.cause for stop in stops_of(play, seed)]
    assert causes == ["program_paused", "stop_by_session"]


@each(
    ("gap", "after_us", "expected"),
    [
        ((0, 300), 30, 0.3),  # over the deadline, and well beyond it
        ((0, 190), 30, 0.0),  # the device's own report ends it
        ((0, 205), 30, 0.0),
        ((0, 231), 30, 0.231),
        ((201, 700), 30, 0.0),  # after it
        ((0, 150), 30, 0.0),  # before it
    ],
)
def test_only_a_gap_over_the_deadline_counts(
    gap: tuple[int, int], after_us: int, expected: float
) -> None:
    """A link that only waits is woken by the report of the deadline, at 200 ms."""
    history = History()
    for number, at_ms in enumerate(gap):
        history.note(Record(number, Kind.ADVANCED, at_ms * 1000))
    assert history.gap_over_s(200_000, after_us * 1000) == expected


def test_a_reversed_wheel_is_asked_about_before_a_cure_is_named() -> None:
    look_at = CAUSES["wheel_reversed"].look_at
    assert look_at.startswith("whether the wheel turned backward")
    assert "`wheelwire setup`" in look_at
    for fault in (Fault.LEFT_REVERSED, Fault.RIGHT_REVERSED):
        asked, motor, forward = map(fault.doc.index, ("turned backward", "motor", "if forward"))
        assert asked < motor < forward < fault.doc.index("encoder")
