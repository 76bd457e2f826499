"""Ticks per wheel turn, from turns by hand."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from ...robot.robot import Robot
from ..files.plant import load_plant, shipped_plants
from .driving import COUNTED_TICKS, SIDES, fresh
from .problems import WRONG_WHEEL, Problem, Unfit
from .questions import HAND, SKIP, TURNED, HandTurn, Person, Question, Say

COUNTS = "counts_per_revolution"
TURNS = 10
_ATTEMPTS = 3
"""Attempts at turning a wheel: Enter may come too early, or the other wheel may turn."""

_USUAL = (360, 1440)
"""In addition to the known motors: an encoder of 360 lines, read on one edge or on all four."""
_SMALLEST_DOUBT = 0.0005
_LARGEST_DOUBT = 0.005


class Counted(NamedTuple):
    """Counts per turn.

    Attributes:
        value: The one to set.
        doubt: What is uncertain about it; empty if nothing is.
    """

    value: int
    doubt: str = ""


@cache
def known_motors() -> dict[str, int]:
    """Counts per wheel turn of the motors that are known by name."""
    return {name: round(load_plant(name).settings[COUNTS]) for name in shipped_plants()}


def ask_counts(robot: Robot, person: Person, say: Say) -> Counted:
    """A number, a known motor, or ten turns of each wheel by hand.

    Raises:
        Unfit: A wheel that was turned forward did not count up.
    """
    motors = known_motors()
    answer = person.answer(
        Question(
            COUNTS,
            "Ticks per wheel turn: count them by hand, or give the number or a known motor.",
            (HAND, *motors),
            HAND,
            COUNTS,
        )
    )
    if answer in motors:
        return Counted(motors[answer])
    if answer != HAND:
        return Counted(round(float(answer)))
    counted = [_by_hand(robot, person, say, wheel) for wheel in (0, 1)]
    if None in counted:
        value = round(robot.parameters[COUNTS])
        return Counted(value, f"not counted: {value} is what the robot has")
    result = plausible(*[ticks for ticks in counted if ticks is not None])
    say(
        f"{TURNS} turns: {counted[0]} ticks on the left, {counted[1]} on the right: "
        f"{result.value} a turn{f' ({result.doubt})' if result.doubt else ''}"
    )
    return result


def plausible(left: float, right: float) -> Counted:
    """The counts per turn that two wheels, turned by hand, most likely have.

    The two differ by as much as the person missed the mark, so their difference is the uncertainty.
    If a usual value lies within it, this is the result; otherwise a multiple of four, because each
    line of a disc makes four edges.
    """
    mean = (left + right) / 2 / TURNS
    difference = abs(left - right) / (left + right) * 2
    # Bounded on both sides: two wheels may agree by chance, and a bad count must not be mistaken
    # for a usual value that is far off.
    doubt = min(max(2 * difference, _SMALLEST_DOUBT), _LARGEST_DOUBT) * mean
    usual = {*_USUAL, *known_motors().values()}
    nearest = min(usual, key=lambda value: abs(value - mean))
    if abs(nearest - mean) > doubt:
        # A single tick in all turns, which is 1 / TURNS in the mean, proves nothing.
        four = 4 * round(mean / 4)
        nearest = four if abs(four - mean) <= max(doubt, 1 / TURNS) else round(mean)
    text = ""
    if difference > _LARGEST_DOUBT:
        text = f"the wheels differ by {difference:.1%}: count again, or give the number"
    elif abs(nearest - mean) > max(doubt, 0.5):
        text = f"{mean:.1f} were counted"
    return Counted(nearest, text)


def _by_hand(robot: Robot, person: Person, say: Say, wheel: int) -> int | None:
    """Ticks of ten turns, or None if the wheel was not turned."""
    name = SIDES[wheel]
    question = Question(
        f"counts_{name}",
        f"Mark the {name} wheel and turn it {TURNS} times forward by hand, then press Enter.",
        (TURNED, SKIP),
        TURNED,
        turn=HandTurn(wheel, TURNS),
    )
    disagrees = False
    for _ in range(_ATTEMPTS):
        before = fresh(robot)
        if person.answer(question) != TURNED:
            return None
        ticks = fresh(robot).since(before)[:2]
        own, other = ticks[wheel], ticks[1 - wheel]
        # The other wheel may move a little while somebody turns this one.
        if own >= COUNTED_TICKS * TURNS and abs(other) <= own / TURNS:
            return own
        detail = f"the left counter counted {ticks[0]} and the right one {ticks[1]}"
        disagrees = max(map(abs, ticks)) >= COUNTED_TICKS * TURNS
        say(f"{detail}: turn the {name} wheel, forward, and press Enter only then")
    if disagrees:
        raise Unfit([Problem(WRONG_WHEEL, wheel, detail)])
    return None
