"""The x4 decoder: signs, and what it says of what it cannot know."""

import itertools
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wheelwire.pi.encoder import ILLEGAL, STEPS, A, B, QuadratureDecoder

LEVELS = ((0, 0), (1, 0), (1, 1), (0, 1))
"""Levels of A and B, a tick apart: forward, A leads B."""
Edge = tuple[int, int]
"""Channel and its new level."""


def edges_of(steps: Iterable[int]) -> list[Edge]:
    """Those of a wheel that goes forward by a tick at each 1, and backward at each -1."""
    edges, position = [], 0
    for step in steps:
        before, after = LEVELS[position % 4], LEVELS[(position + step) % 4]
        channel = A if before[0] != after[0] else B
        edges.append((channel, after[0] if channel == A else after[1]))
        position += step
    return edges


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


@given(st.lists(st.sampled_from((-1, 1)), max_size=200))
def test_every_edge_of_any_motion_is_counted(steps: list[int]) -> None:
    decoder = fed(edges_of(steps))
    assert (decoder.ticks, decoder.illegal) == (sum(steps), 0)


@given(st.integers(0, 1), st.integers(0, 1))
def test_two_changes_in_one_sample_are_illegal_whatever_their_order(a: int, b: int) -> None:
    for first, second in ((A, B), (B, A)):
        decoder = QuadratureDecoder(a, b)
        levels = {A: 1 - a, B: 1 - b}
        decoder.change(first, levels[first], 5)
        decoder.change(second, levels[second], 5)
        assert (decoder.ticks, decoder.illegal) == (0, 1)


def test_a_level_that_does_not_change_shows_lost_edges() -> None:
    decoder = QuadratureDecoder(0, 0)
    decoder.change(A, 1, 1)
    decoder.change(A, 1, 2)
    assert (decoder.ticks, decoder.illegal) == (1, 1)


@given(
    start=st.integers(0, 3),
    jumps=st.lists(st.tuples(st.integers(-9, 9), st.booleans()), max_size=60),
)
def test_illegal_jumps_between_two_samples_are_counted_exactly(
    start: int, jumps: list[tuple[int, bool]]
) -> None:
    """A wheel that turns by any number of ticks between samples: what can be known of it is."""
    position, ticks, illegal = start, 0, 0
    decoder = QuadratureDecoder(*LEVELS[start])
    for stamp, (jump, b_first) in enumerate(jumps):
        before, after = LEVELS[position % 4], LEVELS[(position + jump) % 4]
        changed = [
            (channel, new)
            for channel, old, new in zip((A, B), before, after, strict=True)
            if old != new
        ]
        for channel, level in reversed(changed) if b_first else changed:
            decoder.change(channel, level, stamp)
        position += jump
        ticks += {0: 0, 1: 1, 2: 0, 3: -1}[jump % 4]
        illegal += jump % 4 == 2
        assert (decoder.ticks, decoder.illegal) == (ticks, illegal)


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


@given(st.sets(st.integers(0, 99), max_size=60))
def test_repeated_levels_of_a_channel_reveal_lost_edges(lost: set[int]) -> None:
    """An even number of a channel's edges lost in a row leaves its levels in turn: no trace."""
    edges = edges_of([1] * 100)
    expected = 0
    for channel in (A, B):
        missing = 0
        for index, (changed, _) in enumerate(edges):
            if changed != channel:
                continue
            if index in lost:
                missing += 1
            else:
                expected += missing % 2
                missing = 0
    assert fed([edge for i, edge in enumerate(edges) if i not in lost]).illegal == expected


def test_the_levels_follow_the_grey_code() -> None:
    for before, after in zip(LEVELS, (*LEVELS[1:], LEVELS[0]), strict=True):
        assert (before[0] != after[0]) != (before[1] != after[1])
