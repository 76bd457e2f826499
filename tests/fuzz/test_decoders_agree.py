"""The firmware's decoder and Python's: the same bytes, the same messages, the same counts."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.decoders import by_firmware, by_python
from support.examples import examples
from support.messages import corrupted_captures
from wheelwire_protocol.decoder import NativeDecoder
from wheelwire_protocol.framing import Counters
from wheelwire_protocol.python_decoder import PythonDecoder

VECTORS = Path(__file__).parents[2] / "protocol" / "vectors"
HANDMADE = json.loads((VECTORS / "handmade.json").read_text("utf-8"))
GENERATED = json.loads((VECTORS / "generated.json").read_text("utf-8"))
STREAMS = [bytes.fromhex("".join(stream["bytes"])) for stream in HANDMADE["streams"]]
FRAMES = [bytes.fromhex(vector["frame"]) for vector in GENERATED["frames"]]

# Delimiters, code bytes and the limits of a chunk's length are where decoders differ.
line = st.one_of(
    st.binary(max_size=400),
    st.lists(st.sampled_from([0, 1, 2, 3, 7, 52, 53, 255]), max_size=400).map(bytes),
    corrupted_captures(),
)


@examples(500)
@given(data=line, at=st.lists(st.integers(0, 1000), max_size=6))
def test_any_bytes_in_any_chunking(data: bytes, at: list[int]) -> None:
    bounds = [0, *sorted(position % (len(data) + 1) for position in at), len(data)]
    pieces = [data[begin:end] for begin, end in pairwise(bounds)]
    expected = by_python([data])
    assert by_python(pieces) == expected
    assert by_firmware([data]) == expected
    assert by_firmware(pieces) == expected


@pytest.mark.parametrize("length", range(45, 60))
def test_chunks_about_the_longest(length: int) -> None:
    for tail in (b"", b"\0", b"\0" + FRAMES[0]):
        data = FRAMES[1] + b"\x01" * length + tail
        assert by_python([data]) == by_firmware([data])


def mutate(data: bytearray, random: Random) -> None:
    """Splice something into it: noise, delimiters, or what stands elsewhere in it."""
    begin = random.randrange(len(data) + 1)
    end = min(begin + random.choice([0, 0, 1, 2, 8, 60]), len(data))
    size = random.choice([0, 0, 1, 2, 8, 60])
    source = random.randrange(len(data) + 1)
    what = [random.randbytes(size), bytes(size), bytes(data[source : source + size])]
    data[begin:end] = random.choice(what)


def test_mutations_of_vectors() -> None:
    random = Random(20)
    for _ in range(4000):
        pieces = random.choices(STREAMS, k=2) + random.choices(FRAMES, k=random.randrange(6))
        random.shuffle(pieces)
        data = bytearray().join(pieces)
        for _ in range(random.randrange(5)):
            mutate(data, random)
        assert by_python([bytes(data)]) == by_firmware([bytes(data)]), bytes(data).hex(" ")


def test_parts_longer_than_the_library_takes_at_once() -> None:
    data = b"".join(FRAMES) * 20 + b"\1" * 9000 + b"".join(STREAMS) * 20
    assert by_firmware([data]) == by_python([data])


def test_a_restart_voids_what_had_begun_and_keeps_the_counts() -> None:
    decoders = (NativeDecoder(), PythonDecoder())
    for decoder in decoders:
        decoder.feed(FRAMES[0] + FRAMES[1][:9])
        decoder.restart()
        decoder.feed(FRAMES[1] + b"\1" * 100)
        decoder.restart()
        decoder.feed(FRAMES[2])
        decoder.restart_sequence()
        decoder.feed(FRAMES[0])
    assert decoders[0].counters == decoders[1].counters
    assert decoders[0].counters == Counters(frames=4, bad_cobs=1)
