import struct

import pytest

from wheelwire_protocol.framing import DELIMITER, MAX_ENCODED, Counters, Encoder, encode_frame
from wheelwire_protocol.python_decoder import PythonDecoder
from wheelwire_protocol.types import Estop, SetStreamRate

FRAME = encode_frame(Estop(1, 2), 0)


def test_longest_chunk_is_judged_by_its_content() -> None:
    decoder = PythonDecoder()
    decoder.feed(b"\x01" * MAX_ENCODED)
    assert decoder.counters == Counters()
    decoder.feed(DELIMITER)
    assert decoder.counters == Counters(bad_crc=1)


def test_one_byte_longer_is_counted_before_it_ends() -> None:
    decoder = PythonDecoder()
    decoder.feed(b"\x01" * MAX_ENCODED)
    for more in (1, 1000, 1000):
        decoder.feed(b"\x01" * more)
        assert decoder.counters == Counters(bad_cobs=1)
        assert len(decoder._partial) <= MAX_ENCODED
    assert decoder.feed(b"\x01" * 1000 + DELIMITER + FRAME) == [Estop(1, 2)]
    assert decoder.counters == Counters(bad_cobs=1, frames=1)


def test_a_good_crc_does_not_excuse_a_payload_without_header() -> None:
    decoder = PythonDecoder()
    decoder.feed(DELIMITER + b"\x01" * 5 + DELIMITER)  # the CRC of nothing is four zeros
    assert decoder.counters == Counters(bad_cobs=1)


def test_restart_sequence_forgets_the_expectation() -> None:
    decoder = PythonDecoder()
    decoder.feed(FRAME)
    decoder.restart_sequence()
    decoder.feed(encode_frame(Estop(1, 2), 9))
    assert decoder.counters == Counters(frames=2)


def test_encoder_counts_frames_modulo_65536() -> None:
    encoder, decoder = Encoder(), PythonDecoder()
    for _ in range(65537):
        decoder.feed(encoder.encode(Estop(1, 2)))
    assert decoder.counters == Counters(frames=65537)


def test_value_that_does_not_fit_is_an_error_and_takes_no_sequence_number() -> None:
    encoder = Encoder()
    with pytest.raises(struct.error):
        encoder.encode(SetStreamRate(session_id=1, request_id=1, rate_hz=65536))
    assert encoder.encode(Estop(1, 2)) == FRAME
