"""One direction of the bad line: what it does is what its books say, and the seed repeats it."""

from __future__ import annotations

from random import Random

import pytest

from wheelwire.simulation.impairment import Direction, Faults
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import Ping

COUNT = 500
CHUNKS = (0, 1, 7, 64)


def frames(count: int = COUNT) -> list[bytes]:
    encoder = Encoder()
    return [encoder.encode(Ping(1, number, 0)) for number in range(count)]


def carried(faults: Faults, seed: int = 1, chunk: int = 0) -> tuple[Direction, list[bytes]]:
    """All frames sent, one a millisecond, or as chunks of so many bytes."""
    direction = Direction(faults, Random(seed))
    sent = frames()
    if chunk:
        stream = b"".join(sent)
        sent = [stream[start : start + chunk] for start in range(0, len(stream), chunk)]
    arrived: list[bytes] = []
    for number, data in enumerate(sent):
        direction.send(data, number * 1000)
        arrived += direction.take(number * 1000)
    return direction, arrived + direction.take(10**12)


def test_a_good_line_changes_nothing() -> None:
    direction, arrived = carried(Faults())
    assert b"".join(arrived) == b"".join(frames())
    assert (direction.books.frames, direction.books.hit) == (COUNT, 0)


@pytest.mark.parametrize(
    ("faults", "chunk"),
    [(Faults(loss=0.1), 0)]
    + [(faults, chunk) for faults in (Faults(flip=0.2), Faults(corrupt=0.01)) for chunk in CHUNKS],
)
def test_the_books_know_each_frame_that_is_hit_and_no_other_is_lost(
    faults: Faults, chunk: int
) -> None:
    direction, arrived = carried(faults, chunk=chunk)
    decoder = Decoder()
    decoder.feed(b"".join(arrived))
    assert direction.books.frames == COUNT
    assert direction.books.hit > 0
    assert decoder.counters.frames == COUNT - direction.books.hit


def test_the_seed_repeats_everything() -> None:
    faults = Faults(loss=0.1, repeat=0.1, reorder=0.1, flip=0.1, corrupt=0.01, jitter_us=3000)
    assert carried(faults)[1] == carried(faults)[1]
    assert carried(faults)[1] != carried(faults, seed=2)[1]


def test_repeats_and_changed_places_are_seen_by_the_receiver() -> None:
    direction, arrived = carried(Faults(repeat=0.1, reorder=0.1))
    decoder = Decoder()
    decoder.feed(b"".join(arrived))
    assert direction.books.reordered > 0
    assert decoder.counters.frames == COUNT + direction.books.repeated
    assert decoder.counters.repeated > 0


def test_bytes_one_by_one() -> None:
    _, arrived = carried(Faults(split=True))
    assert {len(piece) for piece in arrived} == {1}


def test_delay_and_baud_rate() -> None:
    direction = Direction(Faults(delay_us=500, baud=100_000), Random(1))
    direction.send(b"\0" + b"x" * 8 + b"\0", 0)
    assert direction.next_us == 500 + 1000
    assert direction.take(1499) == []
    assert len(direction.take(1500)) == 1


def test_what_a_slow_line_cannot_hold_is_lost() -> None:
    direction = Direction(Faults(baud=9600), Random(1))
    for frame in frames():
        direction.send(frame, 0)
    assert direction.books.overrun == direction.books.hit > 0


def test_a_stall_holds_everything_and_loses_nothing() -> None:
    direction = Direction(Faults(), Random(1))
    direction.stall()
    direction.send(frames(1)[0], 0)
    assert direction.take(1_000_000) == []
    direction.resume(1_000_000)
    assert direction.take(1_000_000) == frames(1)


def test_a_line_babbles_at_its_rate() -> None:
    direction = Direction(Faults(noise_bytes_per_s=10_000), Random(1))
    arrived = b"".join(piece for ms in range(1001) for piece in direction.take(ms * 1000))
    assert len(arrived) == pytest.approx(10_000, rel=0.01)


def test_a_cut_frame_ends_in_its_middle() -> None:
    direction = Direction(Faults(), Random(1))
    direction.cut_next()
    whole = frames(2)
    direction.send(whole[0] + whole[1], 0)
    assert direction.take(0) == [whole[0][: len(whole[0]) // 2], whole[1]]
    assert direction.books.hit == 1
