"""Payloads in plain construct with crcmod's CRC: slow, the reference for the fast path."""

from __future__ import annotations

from functools import cache
from typing import Any

import crcmod.predefined
from construct import Checksum, Const, Int8ul, Int16ul, Int32ul, RawCopy, Struct, Terminated, this

from .message import Message

crc32 = crcmod.predefined.mkPredefinedCrcFun("crc-32")


@cache
def payload_struct(message: Message) -> Any:
    """The construct of a whole payload of `message`."""
    return Struct(
        "covered"
        / RawCopy(Struct("id" / Const(message.id, Int8ul), "seq" / Int16ul, "body" / message.body)),
        "crc" / Checksum(Int32ul, crc32, this.covered.data),
        # Otherwise construct would accept bytes behind the CRC.
        Terminated,
    )


def build_payload(message: Message, seq: int, body: dict[str, Any]) -> bytes:
    """The payload bytes of `message`, by construct alone."""
    value = {"covered": {"value": {"seq": seq, "body": body}}}
    return bytes(payload_struct(message).build(value))


def parse_payload(message: Message, payload: bytes) -> tuple[int, dict[str, Any]]:
    """(seq, body) of a payload, by construct alone. Raises `construct.ConstructError`."""
    covered = payload_struct(message).parse(payload).covered.value
    return covered.seq, {field.name: covered.body[field.name] for field in message.fields}
