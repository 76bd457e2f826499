"""The x4 decoder: signs, and what it says of what it cannot know."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wheelwire.pi.encoder import ILLEGAL, STEPS, A, B, QuadratureDecoder

Edge = tuple[int, int]
"""Channel and its new level."""


def fed(edges: list[Edge]) -> QuadratureDecoder:
    decoder = QuadratureDecoder(0, 0)
    for stamp, (channel, level) in enumerate(edges):
        decoder.change(channel, level, stamp)
    return decoder


@pytest.mark.parametrize(
    ("cycle", "ticks"),
    [([(A, 1), (B, 1), (A, 0), (B, 0)], 40), ([(B, 1), (A, 1), (B, 0), (A, 0)], -40)],
    ids=["a leads", "b leads"],
)
def test_when_a_leads_b_the_wheel_goes_forward(cycle: list[Edge], ticks: int) -> None:
    decoder = fed(cycle * 10)
    assert (decoder.ticks, decoder.illegal) == (ticks, 0)


def test_the_table_is_antisymmetric_and_complete() -> None:
    for before, after in itertools.product(range(4), repeat=2):
        there, back = STEPS[before << 2 | after], STEPS[after << 2 | before]
        assert there == -back or there == back == ILLEGAL
    assert STEPS.count(ILLEGAL) == STEPS.count(0) == STEPS.count(1) == STEPS.count(-1) == 4


@given(
    levels=st.tuples(st.integers(0, 1), st.integers(0, 1)),
    samples=st.lists(
        st.lists(st.tuples(st.sampled_from((A, B)), st.integers(0, 1)), min_size=1, max_size=4),
        max_size=40,
    ),
)
def test_any_changes_whatever_are_judged_as_the_textbook_does(
    levels: tuple[int, int], samples: list[list[tuple[int, int]]]
) -> None:
    """One changed channel is a step, forward if A before equals B after; two are illegal."""
    decoder = QuadratureDecoder(*levels)
    now, ticks, illegal = {A: levels[0], B: levels[1]}, 0, 0
    for stamp, changes in enumerate(samples):
        before = dict(now)
        for channel, level in changes:
            decoder.change(channel, level, stamp)
            illegal += now[channel] == level  # there and back, or back and there, was not seen
            now[channel] = level
        changed = [channel for channel in (A, B) if before[channel] != now[channel]]
        illegal += len(changed) == 2
        if len(changed) == 1:
            ticks += 1 if before[A] == now[B] else -1
        assert (decoder.ticks, decoder.illegal) == (ticks, illegal)
