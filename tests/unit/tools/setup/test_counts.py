"""Counts per turn, from ten turns by hand."""

from __future__ import annotations

import pytest

from support.cases import each
from wheelwire.tools.setup.counts import known_motors, plausible


@each("counts", [4, 12, 360, 400, 748, 1000, 1320, 1440, 2496, 4096, 1436])
@each("off", [-1, 0, 1])
def test_exact_turns_give_the_exact_counts(counts: int, off: int) -> None:
    assert plausible(10 * counts, 10 * counts + off).value == counts


@pytest.mark.parametrize(
    ("left", "right", "counts"),
    [(14_380, 14_425, 1440), (3_590, 3_606, 360), (13_170, 13_230, 1320), (24_930, 24_990, 2496)],
)
def test_a_person_misses_the_mark_a_little(left: int, right: int, counts: int) -> None:
    assert plausible(left, right).value == counts


def test_a_count_that_no_disc_has_is_rounded_to_a_tick() -> None:
    assert plausible(14_978, 14_978).value == 1498


def test_wheels_that_differ_are_a_doubt() -> None:
    assert plausible(14_400, 14_400).doubt == ""
    assert "differ by 2.7%" in plausible(14_400, 14_800).doubt


def test_the_known_motors_are_the_plants() -> None:
    assert known_motors() == {"25ga-1440": 1440, "jgb37-520": 1320, "tt-1-48": 2496}
