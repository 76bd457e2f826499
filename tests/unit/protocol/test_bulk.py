import itertools
import tracemalloc
from typing import Any

import numpy as np
import pytest

from wheelwire_protocol import decode_capture, dtype, iter_capture, native
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.python_decoder import PythonDecoder
from wheelwire_protocol.types import ClearFault, ConfigurationValue, Estop, WheelState


@pytest.fixture(params=[True, False], ids=["firmware's decoder", "numpy"], autouse=True)
def with_library(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(native, "is_present", lambda: request.param)


FRAME = encode_frame(Estop(session_id=0x1A2B3C4D, request_id=7), 5)


def test_columns_are_the_fields() -> None:
    states = decode_capture(b"", WheelState)
    assert (states.shape, states.dtype) == ((0,), dtype(WheelState))
    assert states.dtype.names == WheelState._fields
    assert states.dtype["left_mps"] == np.dtype("<f4")


@pytest.mark.parametrize("buffer", [bytes, bytearray, memoryview])
def test_any_bytes_like_capture(buffer: type) -> None:
    assert decode_capture(buffer(FRAME), Estop).tolist() == [(0x1A2B3C4D, 7)]


def test_a_text_keeps_the_zeros_that_fill_it() -> None:
    zeros: list[Any] = [0] * len(ConfigurationValue._fields)
    board = ConfigurationValue(*zeros)._replace(name=b"rover".ljust(24, b"\0"))
    rows = decode_capture(encode_frame(board, 5), ConfigurationValue)
    assert rows.tolist() == [tuple(board)]


@pytest.mark.parametrize("byte", [b"\0", b"\1"], ids=["delimiters", "no delimiter"])
def test_memory_is_bounded_whatever_the_capture(byte: bytes) -> None:
    part = byte * (1 << 20)
    tracemalloc.start()
    try:
        rows = sum(len(array) for array in iter_capture(itertools.repeat(part, 64), Estop))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert rows == 0
    assert peak < 32 * len(part)


def test_last_code_byte_must_point_to_the_end() -> None:
    """A code that points beyond leaves the payload and its CRC as they are."""
    last_code = FRAME.rindex(b"\x05")
    for code in range(1, 256):
        capture = FRAME[:last_code] + bytes([code]) + FRAME[last_code + 1 :]
        streamed = [tuple(message) for message in PythonDecoder().feed(capture)]
        assert decode_capture(capture, Estop).tolist() == streamed
        assert bool(streamed) == (code == FRAME[last_code])


def test_a_frame_with_a_flipped_bit_is_no_row() -> None:
    for position, bit in itertools.product(range(len(FRAME) - 1), range(8)):
        damaged = bytearray(FRAME)
        damaged[position] ^= 1 << bit
        assert decode_capture(damaged, Estop).tolist() == []


def test_another_message_of_the_same_size_is_not_decoded() -> None:
    other = encode_frame(ClearFault(session_id=0x1A2B3C4D, request_id=7), 5)
    assert len(other) == len(FRAME)
    assert decode_capture(other + FRAME + other, Estop).tolist() == [(0x1A2B3C4D, 7)]
