"""What a sound robot reaches, and whether setup names one that does not."""

from __future__ import annotations

import pytest

from support.cases import each
from support.commissioning import PLANTS, tracking
from wheelwire.tools.setup.driving import Pair
from wheelwire.tools.setup.expectation import BEYOND, judge, sound_rms_mps
from wheelwire.tools.tune.before_after import Proof, Trace, there_and_back
from wheelwire_protocol.codes import Fault

COURSE = there_and_back(0.32, 1.0)
ROBOTS = [
    (plant, counts, (number + step) % 2 == 0)
    for number, plant in enumerate(PLANTS)
    for step, counts in enumerate((20, 48, 360))
]
"""Each plant with each count, some of them raised and the others on the floor.

`bench/sound_robots.py` drives all of them.
"""
TICK_M = {48: 0.0042, 20: 0.0102}


def drive(left_mps: float, right_mps: float, period_s: float = 0.01) -> Trace:
    """A drive whose error is the same all the time."""
    times_s = tuple(step * period_s for step in range(round(COURSE.seconds / period_s)))
    still = (Pair(0.0, 0.0),) * len(times_s)
    return Trace(times_s, still, (Pair(left_mps, right_mps),) * len(times_s), 0.013)


def proof(*drives: Trace | None) -> Proof:
    return Proof(COURSE, drives, tuple(Fault(0) for _ in drives))


def test_the_fewer_ticks_the_more_error() -> None:
    errors = [sound_rms_mps(tick_m, 0.32) for tick_m in (0.0001, 0.001, 0.004, 0.01)]
    assert errors == sorted(errors)
    assert sound_rms_mps(0.004, 0.1) < sound_rms_mps(0.004, 0.32)


EXPECTED = sound_rms_mps(TICK_M[48], 0.32)
BAD, GOOD = BEYOND * EXPECTED + 1e-3, BEYOND * EXPECTED - 1e-3


@each(
    "drives, sides",
    [
        ((drive(GOOD, GOOD), drive(GOOD, GOOD)), []),
        ((drive(GOOD, BAD), drive(GOOD, BAD)), [1]),
        # The values that track better stay.
        ((drive(GOOD, GOOD), drive(BAD, BAD)), []),
        ((drive(BAD, BAD), drive(GOOD, BAD)), [1]),
        # A fault ended the first drive.
        ((None, drive(BAD, BAD)), [0, 1]),
    ],
)
def test_a_wheel_beyond_what_a_sound_robot_reaches_is_named(
    drives: tuple[Trace | None, ...], sides: list[int]
) -> None:
    assert [problem.side for problem in judge(proof(*drives), EXPECTED, 48)] == sides


def test_the_message_has_both_errors_and_the_ticks() -> None:
    (problem, _) = judge(proof(drive(0.052, 0.052)), 0.036, 48)
    assert str(problem).startswith(
        "left wheel tracks badly: its tracking error is 52 mm/s, where a sound robot of 48 ticks "
        "per turn reaches 36: its encoder may miss a magnet"
    )


def test_what_late_setpoints_may_have_caused_is_no_fault_of_an_encoder() -> None:
    late = drive(BAD, BAD, period_s=0.12)
    for drives in ((drive(BAD, BAD), late), (late, drive(BAD, BAD)), (None, late)):
        (problem,) = judge(proof(*drives), EXPECTED, 48)
        assert str(problem).startswith("setpoints came late: up to 120 ms apart, because")
    assert judge(proof(late, drive(GOOD, GOOD)), EXPECTED, 48) == []
    assert late.late_mps(COURSE) > 0.3 * EXPECTED > 10 * drive(BAD, BAD).late_mps(COURSE) / 2


@pytest.mark.whole
@pytest.mark.parametrize(("plant", "counts", "raised"), ROBOTS)
def test_a_sound_robot_of_any_count_is_within(plant: str, counts: int, raised: bool) -> None:
    found = tracking(plant, counts, raised=raised)
    assert max(found.rms_mps) < BEYOND * found.expected_mps
    assert max(found.rms_mps) > 0.4 * found.expected_mps


@pytest.mark.whole
@pytest.mark.parametrize(("plant", "raised"), [*zip(PLANTS, (True, False, True), strict=True)])
def test_at_48_ticks_a_missing_magnet_is_beyond(plant: str, raised: bool) -> None:
    found = tracking(plant, 48, raised=raised, settings={"right.magnet_missing": 1})
    left, right = (rms > BEYOND * found.expected_mps for rms in found.rms_mps)
    assert (left, right) == (False, True)
