"""The self-test's messages: apart from all others, and on the wire as they are defined."""

import struct

from support.cases import each
from support.self_test_types import HASH, LAYOUTS
from support.self_test_wire import Encoder, decoder
from wheelwire_protocol.codec import BY_ID, schema_hash
from wheelwire_protocol.codes import Group
from wheelwire_protocol.framing import MAX_PAYLOAD, cobs_encode
from wheelwire_protocol.generate import wire_layout
from wheelwire_protocol.message import Message
from wheelwire_protocol.messages import MESSAGES
from wheelwire_protocol.reference import build_payload
from wheelwire_protocol.self_test import GROUP
from wheelwire_protocol.self_test import MESSAGES as SELF_TEST


def test_no_other_message_has_their_ids_or_names() -> None:
    for definitions in (BY_ID, {m.name: m for m in MESSAGES}):
        assert not {m.id for m in SELF_TEST} & set(definitions)
        assert not {m.name for m in SELF_TEST} & set(definitions)
    assert all(m.id & 0x70 == 0x70 for m in SELF_TEST)
    assert len({m.id for m in SELF_TEST}) == len(SELF_TEST)


def test_no_other_group_has_their_number() -> None:
    assert GROUP not in {group.value for group in Group}


def test_the_hash_is_theirs_alone() -> None:
    assert wire_layout.self_test_hash() == HASH
    assert HASH not in {schema_hash(group) for group in Group}
    assert "SelfTest" not in "".join(map(wire_layout.wire_layout, Group))


@each("message", SELF_TEST, ids=lambda message: message.name)
def test_frames_are_those_of_construct(message: Message) -> None:
    (kind,) = (kind for id_, kind, _ in LAYOUTS if id_ == message.id)
    assert message.payload_size <= MAX_PAYLOAD
    body = bytes(range(1, message.body_size + 1))
    values = struct.unpack("<" + message.body_format, body)
    names = [field.name for field in message.fields]
    payload = build_payload(message, 0, dict(zip(names, values, strict=True)))
    frame = b"\0" + cobs_encode(payload) + b"\0"
    assert Encoder().encode(kind(*values)) == frame
    assert decoder().feed(frame) == [kind(**dict(zip(names, values, strict=True)))]
    assert message.doc.endswith(".")
    assert all(field.docs.endswith(".") for field in message.fields if field.docs)
