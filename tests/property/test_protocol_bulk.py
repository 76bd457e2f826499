"""Bulk decoding finds the frames that the stream decoder finds."""

from unittest.mock import patch

from hypothesis import given, settings
from hypothesis import strategies as st

from support.messages import any_message, corrupted_captures, messages_of
from wheelwire_protocol import bulk, codec, decode_capture, types
from wheelwire_protocol.framing import Decoder
from wheelwire_protocol.types import AnyMessage, ParameterGet, WheelState

message_types = st.sampled_from(list(codec.BY_TYPE))


def check(data: bytes, message_type: type[AnyMessage]) -> None:
    expected = [tuple(m) for m in Decoder().feed(data) if type(m) is message_type]
    assert decode_capture(data, message_type).tolist() == expected


@given(data=corrupted_captures(), message_type=message_types)
def test_any_message_in_a_mixed_capture(data: bytes, message_type: type[AnyMessage]) -> None:
    check(data, message_type)


@settings(deadline=None)  # the table of the CRC is built in the first example
@given(
    data=corrupted_captures(st.one_of(messages_of(WheelState), any_message)),
    block=st.integers(1, 200),
)
def test_any_size_of_block(data: bytes, block: int) -> None:
    with patch.object(bulk, "_BLOCK_SIZE", block):
        check(data, WheelState)


@given(data=corrupted_captures(messages_of(ParameterGet)))
def test_a_message_of_even_and_of_odd_size(data: bytes) -> None:
    check(data, types.ParameterGet)
    check(data, types.SetStreamRate)


@given(data=st.lists(st.sampled_from([0, 1, 2, 16, 255]), max_size=400).map(bytes))
def test_noise(data: bytes) -> None:
    check(data, types.Estop)
