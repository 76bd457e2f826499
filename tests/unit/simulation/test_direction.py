"""One direction of the bad line: its ground truth matches what it does, and the seed repeats it."""

from __future__ import annotations

from random import Random

import pytest

from wheelwire.simulation.bad_line import Direction, Impairment
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import Ping

COUNT = 500
CHUNKS = (0, 1, 7, 64)


def frames(count: int = COUNT) -> list[bytes]:
    encoder = Encoder()
    return [encoder.encode(Ping(1, number, 0)) for number in range(count)]


def carried(impairment: Impairment, seed: int = 1, chunk: int = 0) -> tuple[Direction, list[bytes]]:
    """All frames sent, one a millisecond, or as chunks of so many bytes."""
    direction = Direction(impairment, Random(seed))
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
    direction, arrived = carried(Impairment())
    assert b"".join(arrived) == b"".join(frames())
    assert (direction.truth.frames, direction.truth.hit) == (COUNT, 0)


@pytest.mark.parametrize(
    ("impairment", "chunk"),
    [(Impairment(loss=0.1), 0)]
    + [
        (impairment, chunk)
        for impairment in (Impairment(flip=0.2), Impairment(corrupt=0.01))
        for chunk in CHUNKS
    ],
)
def test_the_ground_truth_has_each_frame_that_is_hit_and_no_other_is_lost(
    impairment: Impairment, chunk: int
) -> None:
    direction, arrived = carried(impairment, chunk=chunk)
    decoder = Decoder()
    decoder.feed(b"".join(arrived))
    assert direction.truth.frames == COUNT
    assert direction.truth.hit > 0
    assert decoder.counters.frames == COUNT - direction.truth.hit


def test_the_seed_repeats_everything() -> None:
    impairment = Impairment(
        loss=0.1, repeat=0.1, reorder=0.1, flip=0.1, corrupt=0.01, jitter_us=3000
    )
    assert carried(impairment)[1] == carried(impairment)[1]
    assert carried(impairment)[1] != carried(impairment, seed=2)[1]


def test_repeats_and_changed_places_are_seen_by_the_receiver() -> None:
    direction, arrived = carried(Impairment(repeat=0.1, reorder=0.1))
    decoder = Decoder()
    decoder.feed(b"".join(arrived))
    assert direction.truth.reordered > 0
    assert decoder.counters.frames == COUNT + direction.truth.repeated
    assert decoder.counters.repeated > 0


def test_bytes_one_by_one() -> None:
    _, arrived = carried(Impairment(split=True))
    assert {len(piece) for piece in arrived} == {1}


def test_delay_and_baud_rate() -> None:
    direction = Direction(Impairment(delay_us=500, baud_rate=100_000), Random(1))
    direction.send(b"\0" + b"x" * 8 + b"\0", 0)
    assert direction.next_us == 500 + 1000
    assert direction.take(1499) == []
    assert len(direction.take(1500)) == 1


def test_what_a_slow_line_cannot_hold_is_lost() -> None:
    direction = Direction(Impairment(baud_rate=9600), Random(1))
    for frame in frames():
        direction.send(frame, 0)
    assert direction.truth.overrun == direction.truth.hit > 0


def test_a_stall_holds_everything_and_loses_nothing() -> None:
    direction = Direction(Impairment(), Random(1))
    direction.stall()
    direction.send(frames(1)[0], 0)
    assert direction.take(1_000_000) == []
    direction.resume(1_000_000)
    assert direction.take(1_000_000) == frames(1)


def test_a_line_babbles_at_its_rate() -> None:
    direction = Direction(Impairment(noise_bytes_per_s=10_000), Random(1))
    arrived = b"".join(piece for ms in range(1001) for piece in direction.take(ms * 1000))
    assert len(arrived) == pytest.approx(10_000, rel=0.01)


def test_a_cut_frame_ends_in_its_middle() -> None:
    direction = Direction(Impairment(), Random(1))
    direction.cut_pending = True
    whole = frames(2)
    direction.send(whole[0] + whole[1], 0)
    assert direction.take(0) == [whole[0][: len(whole[0]) // 2], whole[1]]
    assert direction.truth.hit == 1
