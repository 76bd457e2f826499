"""Bulk decoding finds the frames that the stream decoder finds, by the library and by numpy."""

import itertools
from collections.abc import Iterator
from unittest.mock import patch

from hypothesis import given
from hypothesis import strategies as st

from support.messages import any_message, corrupted_captures, messages_of
from wheelwire_protocol import bulk, codec, decode_capture, iter_capture, native, types
from wheelwire_protocol.framing import MAX_ENCODED, encode_frame
from wheelwire_protocol.python_decoder import PythonDecoder
from wheelwire_protocol.types import AnyMessage, WheelState

message_types = st.sampled_from(list(codec.BY_TYPE))


def check(data: bytes, message_type: type[AnyMessage]) -> None:
    expected = [tuple(m) for m in PythonDecoder().feed(data) if type(m) is message_type]
    for by_library in (True, False):
        with patch.object(native, "is_present", return_value=by_library):
            assert decode_capture(data, message_type).tolist() == expected


def cut(data: bytes, sizes: list[int]) -> Iterator[bytes]:
    """The data in parts of these sizes, over and over, and the rest."""
    at = 0
    for size in itertools.islice(itertools.cycle(sizes), len(data)):
        yield data[at : at + size]
        at += size
    yield data[at:]


@given(data=corrupted_captures(), message_type=message_types)
def test_any_message_in_a_mixed_capture(data: bytes, message_type: type[AnyMessage]) -> None:
    check(data, message_type)


@given(
    data=corrupted_captures(st.one_of(messages_of(WheelState), any_message)),
    block=st.integers(1, 200),
)
def test_any_size_of_block(data: bytes, block: int) -> None:
    with patch.object(bulk, "_BLOCK_SIZE", block):
        check(data, WheelState)


@given(
    data=corrupted_captures(st.one_of(messages_of(WheelState), any_message)),
    sizes=st.lists(st.integers(0, 120), min_size=1, max_size=8),
)
def test_any_cutting_into_parts(data: bytes, sizes: list[int]) -> None:
    expected = [tuple(m) for m in PythonDecoder().feed(data) if type(m) is WheelState]
    arrays = iter_capture(cut(data, sizes), WheelState)
    assert [row for array in arrays for row in array.tolist()] == expected


@given(
    noise=st.binary(min_size=1).map(lambda noise: noise.replace(b"\0", b"\1")),
    sizes=st.lists(st.integers(1, 9), min_size=1, max_size=8),
)
def test_the_end_of_what_is_too_long_is_no_frame(noise: bytes, sizes: list[int]) -> None:
    frame = encode_frame(types.Estop(session_id=0x1A2B3C4D, request_id=7), 5)
    overlong = (noise * (MAX_ENCODED + 1) + frame[1:]) + frame
    arrays = iter_capture(cut(overlong, sizes), types.Estop)
    assert [row for array in arrays for row in array.tolist()] == [(0x1A2B3C4D, 7)]
