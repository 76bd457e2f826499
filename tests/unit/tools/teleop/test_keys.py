from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from support.cases import each
from wheelwire.tools.teleop.keys import (
    DOWN,
    INTERRUPT,
    LEFT,
    RIGHT,
    SPACE,
    UP,
    Action,
    Event,
    KeyboardFlags,
    KeyDecoder,
    KeyEvent,
)

TYPED, PRESSED, REPEATED, RELEASED = Action

SEQUENCES: list[tuple[bytes, list[Event]]] = [
    (b"w", [KeyEvent("w", TYPED)]),
    (b"W", [KeyEvent("w", TYPED)]),
    (b" ", [KeyEvent(SPACE, TYPED)]),
    (b"\x1b[A", [KeyEvent(UP, TYPED)]),
    (b"\x1b[B", [KeyEvent(DOWN, TYPED)]),
    (b"\x1b[C", [KeyEvent(RIGHT, TYPED)]),
    (b"\x1b[D", [KeyEvent(LEFT, TYPED)]),
    (b"\x1bOA", [KeyEvent(UP, TYPED)]),  # a keypad in application mode
    (b"\x1b[1;2A", [KeyEvent(UP, TYPED)]),  # with shift
    (b"\x03", [KeyEvent(INTERRUPT, TYPED)]),
    (b"\x1a", [KeyEvent(INTERRUPT, TYPED)]),
    # the kitty keyboard protocol
    (b"\x1b[119u", [KeyEvent("w", PRESSED)]),
    (b"\x1b[119;1:1u", [KeyEvent("w", PRESSED)]),
    (b"\x1b[119;1:2u", [KeyEvent("w", REPEATED)]),
    (b"\x1b[119;1:3u", [KeyEvent("w", RELEASED)]),
    (b"\x1b[119:87;2;87u", [KeyEvent("w", PRESSED)]),  # shift, other key, text
    (b"\x1b[119;65:2u", [KeyEvent("w", REPEATED)]),  # caps lock
    (b"\x1b[119;129u", [KeyEvent("w", PRESSED)]),  # num lock
    (b"\x1b[119;5:3u", [KeyEvent("w", RELEASED)]),  # ctrl was pressed meanwhile
    (b"\x1b[32;5u", [KeyEvent(SPACE, PRESSED)]),
    (b"\x1b[1;1:1A", [KeyEvent(UP, PRESSED)]),
    (b"\x1b[1;1:2D", [KeyEvent(LEFT, REPEATED)]),
    (b"\x1b[1;1:3C", [KeyEvent(RIGHT, RELEASED)]),
    (b"\x1b[99;5u", [KeyEvent(INTERRUPT, PRESSED)]),
    (b"\x1b[?11u", [KeyboardFlags(11)]),
    (b"\x1b[?0u", [KeyboardFlags(0)]),
    # no keys of ours
    (b"\x1b[119;5u", []),  # ctrl W
    (b"\x1b[1;5A", []),  # ctrl up
    (b"\x1b[[A", []),  # F1 of the Linux console
    (b"\x1b[15~", []),
    (b"\x1b[57441;2u", []),  # shift alone
    (b"\x1b[?62;c", []),
    (b"\x1b[57443;5u", []),  # alt with ctrl
    (b"\x1b[;;;u", []),
    (b"\x1bOP", []),
    (b"\xc3\xa9", []),
    (b"\r\n\t\x7f", []),
    (b"\x1b[a", []),
    (b"\x1b[" + b"1" * 40 + b"A", [KeyEvent(c, TYPED) for c in "1" * 10 + "a"]),
    # what interrupts a sequence is not swallowed with it
    (b"\x1b\x1b[A", [KeyEvent(UP, TYPED)]),
    (b"\x1bw", [KeyEvent("w", TYPED)]),
    (b"\x1b[1;\x1b[B", [KeyEvent(DOWN, TYPED)]),
    (b"\x1b[1;\x03", [KeyEvent(INTERRUPT, TYPED)]),
]


@each(("data", "events"), SEQUENCES, ids=lambda value: str(value)[:40])
def test_a_sequence_is_decoded(data: bytes, events: list[Event]) -> None:
    assert KeyDecoder().feed(data) == events
    one_by_one = KeyDecoder()
    assert [event for byte in data for event in one_by_one.feed(bytes([byte]))] == events


@given(
    st.lists(
        st.one_of(st.sampled_from([data for data, _ in SEQUENCES]), st.binary(max_size=6)),
        max_size=12,
    ).map(b"".join),
    st.lists(st.integers(0, 200), max_size=10),
)
def test_it_does_not_matter_where_the_bytes_are_split(data: bytes, cuts: list[int]) -> None:
    bounds = [0, *sorted(cut for cut in cuts if cut < len(data)), len(data)]
    decoder = KeyDecoder()
    portions = [data[low:high] for low, high in itertools.pairwise(bounds)]
    events = [event for portion in portions for event in decoder.feed(portion)]
    assert events == KeyDecoder().feed(data)


@given(st.binary(max_size=50))
def test_a_space_is_always_a_space(before: bytes) -> None:
    decoder = KeyDecoder()
    decoder.feed(before)
    assert decoder.feed(b" ") == [KeyEvent(SPACE, TYPED)]
