"""All that is derived from a definition says the same as plain construct."""

import zlib
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from support.messages import bodies, definitions, seqs
from wheelwire_protocol import dtype, types
from wheelwire_protocol.codec import BY_ID, CRC_SIZE, HEADER_SIZE
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import CRC_RESIDUE, encode_frame, encode_payload
from wheelwire_protocol.message import Message
from wheelwire_protocol.reference import build_payload, crc32, parse_payload


@given(data=st.data(), definition=definitions, seq=seqs)
def test_fast_path_equals_construct(data: st.DataObject, definition: Message, seq: int) -> None:
    body = data.draw(bodies(definition))
    message = getattr(types, definition.name)(**body)
    payload = build_payload(definition, seq, body)

    assert encode_payload(message, seq) == payload
    assert parse_payload(definition, payload) == (seq, body)
    assert BY_ID[definition.id].unpack(payload) == tuple(message)
    assert Decoder().feed(encode_frame(message, seq)) == [message]


@given(data=st.data(), definition=definitions, seq=seqs)
def test_dtype_equals_construct(data: st.DataObject, definition: Message, seq: int) -> None:
    body = data.draw(bodies(definition))
    payload = build_payload(definition, seq, body)
    rows: Any = np.frombuffer(
        payload[HEADER_SIZE:-CRC_SIZE], dtype(getattr(types, definition.name))
    )
    assert {name: rows[name].item() for name in rows.dtype.names} == body


@given(data=st.binary(max_size=300))
def test_zlib_equals_crcmod(data: bytes) -> None:
    assert zlib.crc32(data) == crc32(data)


@given(data=st.binary(max_size=300))
def test_crc_of_data_and_its_crc_is_the_residue(data: bytes) -> None:
    assert zlib.crc32(data + crc32(data).to_bytes(CRC_SIZE, "little")) == CRC_RESIDUE
