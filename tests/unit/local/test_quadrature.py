"""The x4 decoder: signs, and what it says of what it cannot know."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from wheelwire.local.quadrature import ILLEGAL, STEPS, A, B, QuadratureDecoder
from wheelwire.plant.encoder import LEVELS, Edge, Encoder

TURN_RAD = 6.283185307179586


def fed(edges: list[Edge]) -> QuadratureDecoder:
    decoder = QuadratureDecoder(0, 0)
    for stamp, edge in enumerate(edges):
        decoder.change(edge.channel, edge.level, stamp)
    return decoder


def test_when_a_leads_b_the_wheel_goes_forward() -> None:
    decoder = QuadratureDecoder(0, 0)
    for stamp, (channel, level) in enumerate([(A, 1), (B, 1), (A, 0), (B, 0)] * 10):
        decoder.change(channel, level, stamp)
    assert (decoder.ticks, decoder.illegal) == (40, 0)


def test_when_b_leads_a_it_goes_backward() -> None:
    decoder = QuadratureDecoder(0, 0)
    for stamp, (channel, level) in enumerate([(B, 1), (A, 1), (B, 0), (A, 0)] * 10):
        decoder.change(channel, level, stamp)
    assert (decoder.ticks, decoder.illegal) == (-40, 0)


def test_the_table_is_antisymmetric_and_complete() -> None:
    for before, after in itertools.product(range(4), repeat=2):
        there, back = STEPS[before << 2 | after], STEPS[after << 2 | before]
        assert there == -back or there == back == ILLEGAL
    assert STEPS.count(ILLEGAL) == STEPS.count(0) == STEPS.count(1) == STEPS.count(-1) == 4


@given(st.lists(st.floats(-3, 3), max_size=20))
def test_every_edge_of_any_motion_is_counted(turns: list[float]) -> None:
    encoder = Encoder(360)
    start = encoder.ticks
    decoder = fed([edge for turn in turns for edge in encoder.turn(turn * TURN_RAD / 50)])
    assert decoder.ticks == encoder.ticks - start
    assert decoder.illegal == 0


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


@given(st.sets(st.integers(0, 99), min_size=1, max_size=10))
def test_lost_edges_leave_a_trace_unless_four_in_a_row_are_lost(lost: set[int]) -> None:
    edges = list(Encoder(360).turn(TURN_RAD))[:100]
    seen = [edge for index, edge in enumerate(edges) if index not in lost]
    decoder = fed(seen)
    runs = sum(1 for index in lost if index + 1 not in lost and index != 99)
    hidden = sum(
        1 for start in range(97) if {start, start + 1, start + 2, start + 3} <= lost
    )  # a whole cycle looks like nothing
    assert decoder.illegal > 0 or runs == 0 or hidden > 0


def test_the_levels_follow_the_grey_code() -> None:
    for before, after in zip(LEVELS, (*LEVELS[1:], LEVELS[0]), strict=True):
        assert (before[0] != after[0]) != (before[1] != after[1])
