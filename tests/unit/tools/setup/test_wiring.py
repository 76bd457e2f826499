"""The deduction of the wiring, from what the counters did and what a person saw."""

from __future__ import annotations

from itertools import product

from support.cases import each
from wheelwire.tools.setup.driving import Pulsed
from wheelwire.tools.setup.problems import (
    BOTH_TURNED,
    CHANNEL_DEAD,
    CHANNELS_MIXED,
    NO_ENCODER,
    SAME_ENCODER,
    SHARED_COUNTER,
    UNSEEN,
    Problem,
)
from wheelwire.tools.setup.wiring import Seen, Wiring, deduce, find_problems
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, Kind

WIRINGS = [Wiring(*map(bool, wired)) for wired in product((0, 1), repeat=6)]


def seen(answer: str, left: int, right: int, toggles: tuple[int, int] = (9, 9)) -> Seen:
    return Seen(Pulsed(0.2, (left, right), toggles), answer)


def pulsed(wiring: Wiring, bridge: int) -> Seen:
    """What a pulse of one bridge shows, by the definition of a wiring."""
    wheel = bridge ^ wiring.motors_swapped
    side = ("left", "right")[wheel]
    forward = -1 if getattr(wiring, f"{side}_motor_reversed") else 1
    counted = -forward if getattr(wiring, f"{side}_encoder_reversed") else forward
    left, right = (20 * counted, 0) if wheel == wiring.encoders_swapped else (0, 20 * counted)
    return seen(f"{side} {'forward' if forward > 0 else 'backward'}", left, right, (0, 0))


@each("wiring", WIRINGS, ids=lambda w: "".join(str(v) for v in w.corrections))
def test_each_wiring_is_deduced(wiring: Wiring) -> None:
    first, second = pulsed(wiring, 0), pulsed(wiring, 1)
    assert find_problems(first, second) == []
    assert deduce(first, second) == wiring
    assert Wiring.of_corrections(wiring.corrections) == wiring


def test_each_correction_is_a_parameter() -> None:
    assert {PARAMETER_BY_NAME[name].kind for name in Wiring().corrections} == {Kind.SWITCH}


GOOD = seen("right forward", 0, 20, (0, 5))


@each(
    ("first", "second", "problems"),
    [
        (seen("left forward", 0, 0, (0, 0)), GOOD, [Problem(NO_ENCODER, 0)]),
        (seen("left forward", 1, 0, (9, 0)), GOOD, [Problem(CHANNEL_DEAD, 0)]),
        (seen("left forward", 1, 0), seen("right forward", 0, 1), [Problem(CHANNELS_MIXED)]),
        (GOOD, seen("left forward", -30, -30), [Problem(SAME_ENCODER, 0)]),
        (
            seen("right backward", 0, 0, (0, 0)),
            seen("left forward", 9, 9),
            [Problem(SAME_ENCODER, 0)],
        ),
        (seen("both", 20, 20), GOOD, [Problem(BOTH_TURNED)]),
        (seen("none", 20, 0), GOOD, [Problem(UNSEEN)]),
        (seen("left forward", 0, 20, (0, 9)), GOOD, [Problem(SHARED_COUNTER)]),
        (seen("none", 0, 0, (0, 0)), GOOD, []),
    ],
)
def test_what_no_wiring_explains_is_named(
    first: Seen, second: Seen, problems: list[Problem]
) -> None:
    assert find_problems(first, second) == problems


def test_a_problem_is_in_words() -> None:
    assert str(Problem(NO_ENCODER, 1)).startswith("right motor without encoder: the right wheel")
    assert "{" not in str(Problem(BOTH_TURNED))
