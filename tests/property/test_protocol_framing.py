"""The decoder, whatever the line brings and however it is cut."""

from dataclasses import dataclass, field
from itertools import accumulate, pairwise

from hypothesis import example, given
from hypothesis import strategies as st

from support.messages import any_message, corrupted_captures, messages_of, seqs
from wheelwire_protocol.framing import DELIMITER, MAX_ENCODED, Counters, Encoder, encode_frame
from wheelwire_protocol.python_decoder import PythonDecoder
from wheelwire_protocol.types import AnyMessage, Estop, WheelState


def cut(data: bytes, at: list[int]) -> list[bytes]:
    bounds = [0, *sorted(position % (len(data) + 1) for position in at), len(data)]
    return [data[begin:end] for begin, end in pairwise(bounds)]


def decode(data: bytes) -> tuple[list[AnyMessage], Counters]:
    decoder = PythonDecoder()
    return decoder.feed(data), decoder.counters


noise = st.one_of(
    st.binary(max_size=400),
    st.lists(st.sampled_from([0, 1, 2, 7, 255]), max_size=400).map(bytes),
    corrupted_captures(),
)


@given(sent=st.lists(any_message, max_size=8), at=st.lists(st.integers(0, 10_000), max_size=8))
def test_messages_arrive_in_any_chunking(sent: list[AnyMessage], at: list[int]) -> None:
    encoder, decoder = Encoder(), PythonDecoder()
    stream = b"".join(map(encoder.encode, sent))
    received = [message for part in cut(stream, at) for message in decoder.feed(part)]
    assert received == sent
    assert decoder.counters == Counters(frames=len(sent))


@given(data=noise, at=st.lists(st.integers(0, 10_000), max_size=8))
def test_chunking_changes_nothing(data: bytes, at: list[int]) -> None:
    decoder = PythonDecoder()
    received = [message for part in cut(data, at) for message in decoder.feed(part)]
    assert (received, decoder.counters) == decode(data)


@given(data=noise)
def test_every_chunk_is_accounted_for(data: bytes) -> None:
    received, counters = decode(data + DELIMITER)
    chunks = [chunk for chunk in data.split(DELIMITER) if chunk]
    assert len(received) == counters.frames
    assert counters.frames + counters.bad == len(chunks)


@given(parts=st.lists(st.binary(max_size=200), max_size=20))
def test_memory_is_bounded(parts: list[bytes]) -> None:
    decoder = PythonDecoder()
    for part in parts:
        decoder.feed(part)
        assert len(decoder._partial) <= MAX_ENCODED


@given(
    sent=st.tuples(*[messages_of(WheelState)] * 3),
    at=st.integers(0, 1000),
    byte=st.integers(1, 255),
)
def test_a_changed_byte_costs_the_frame_that_it_hits(
    sent: tuple[WheelState, ...], at: int, byte: int
) -> None:
    frames = [encode_frame(message, seq) for seq, message in enumerate(sent)]
    stream = bytearray(b"".join(frames))
    at %= len(stream)
    stream[at] ^= byte
    received, counters = decode(bytes(stream))
    hit = at // len(frames[0])
    assert received == [message for index, message in enumerate(sent) if index != hit]
    assert counters.seq_lost == (1 if hit == 1 else 0)


@dataclass
class SeqModel:
    """SPEC.md's table, row by row."""

    expected: int | None = None
    lost: int = 0
    repeated: int = 0
    newest: int = 0
    """Frames sent so far, as the receiver sees it: what `expected` counts, without a wrap."""
    missing: set[int] = field(default_factory=set)

    def take(self, seq: int) -> None:
        ahead = 0 if self.expected is None else (seq - self.expected) % 65536
        if 65472 <= ahead <= 65535:
            late = self.newest - (65536 - ahead)
            self.lost -= late in self.missing
            self.repeated += late not in self.missing
            self.missing.discard(late)
            return
        if 1 <= ahead <= 32767:
            self.lost += ahead
            self.missing |= set(range(self.newest, self.newest + ahead))
            self.newest += ahead
        elif ahead:
            self.missing.clear()
        self.newest += 1
        self.expected = (seq + 1) % 65536


def check_counts(seqs_sent: list[int]) -> None:
    model = SeqModel()
    for seq in seqs_sent:
        model.take(seq)
    _, counters = decode(b"".join(encode_frame(Estop(1, 2), seq) for seq in seqs_sent))
    assert counters == Counters(frames=len(seqs_sent), seq_lost=model.lost, repeated=model.repeated)


@given(sent=st.lists(seqs, max_size=12))
@example(sent=[65535, 0, 65535, 1])
@example(sent=[99, 36, 100, 35])
@example(sent=[0, 3, 1, 1, 4, 2, 2])
@example(sent=[0, 65, 1, 66, 2, 1])
@example(sent=[65530, 2, 65535, 0, 0, 3, 65531])
def test_any_sequence_is_counted_as_specified(sent: list[int]) -> None:
    check_counts(sent)


edges = st.sampled_from([0, 1, 2, 64, 65, 66, 32767, 32768, 32769, 65470, 65471, 65472, 65535])


@given(start=seqs, steps=st.lists(edges, max_size=12))
def test_steps_at_the_limits_are_counted_as_specified(start: int, steps: list[int]) -> None:
    check_counts(list(accumulate(steps, lambda seq, step: (seq + step) % 65536, initial=start)))
