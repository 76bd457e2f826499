"""The sentences on the simulated robot's wheels."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from wheelwire.simulation.narration import Narrator
from wheelwire.simulation.simulator import TrueState, parse_true_state

PERIOD_US = 50_000
COUNTS = 1000.0


def state(number: int, left: int, right: int) -> TrueState:
    line = {"event": "truth", "state": 0, "faults": 0, "t_us": number * PERIOD_US}
    rest = {name: 0 for name in TrueState.__dataclass_fields__ if name not in line}
    return parse_true_state({**rest, **line, "left_ticks": left, "right_ticks": right})


def said(steps: Iterable[tuple[int, int]], first: tuple[int, int] = (0, 0)) -> list[str]:
    """What the narrator reports when wheels make these steps, one a period, and then rest.

    Args:
        steps: Of both wheels.
        first: The step before the first state.
    """
    told: list[str] = []
    narrator = Narrator(COUNTS, told.append)
    left = right = 0
    for number, (of_left, of_right) in enumerate([first, *steps, *[(0, 0)] * 10]):
        left, right = left + of_left, right + of_right
        narrator.watch(state(number, left, right))
    return told


@pytest.mark.parametrize(
    ("steps", "sentence"),
    [
        ([(100, 0)] * 4, "the left wheel turned forward 0.40 turns"),
        ([(0, -250)], "the right wheel turned backward 0.25 turns"),
        ([(100, 100)] * 3, "both wheels turned forward 0.30 turns"),
        (
            [(100, -10)] * 3,
            "the left wheel turned forward 0.30 turns, the right wheel turned backward 0.03 turns",
        ),
        ([(500, 0), (-200, 0)], "the left wheel turned forward 0.50 turns and backward 0.20 turns"),
    ],
)
def test_a_motion_is_one_sentence(steps: list[tuple[int, int]], sentence: str) -> None:
    assert said(steps) == [sentence]


def test_a_motion_that_has_begun_before_the_first_state_is_told_whole() -> None:
    assert said([(100, 0)], first=(20, 0)) == ["the left wheel turned forward 0.12 turns"]


def test_invisible_movements_are_not_mentioned() -> None:
    assert said([(2, -2)]) == []
    assert said([(100, 2)]) == ["the left wheel turned forward 0.10 turns"]


def test_a_short_rest_is_within_a_motion_and_a_long_one_is_not() -> None:
    assert said([(100, 0), *[(0, 0)] * 5, (100, 0)]) == ["the left wheel turned forward 0.20 turns"]
    assert said([(100, 0), *[(0, 0)] * 9, (0, 100)]) == [
        "the left wheel turned forward 0.10 turns",
        "the right wheel turned forward 0.10 turns",
    ]
