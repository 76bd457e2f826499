"""A tap's record as a message of a file: `std_msgs/msg/UInt8MultiArray` in CDR."""

from __future__ import annotations

import struct

from ..link.traffic import Kind, Record
from .cdr import HEADER

RECEIVED = "/wheelwire/received"
SENT = "/wheelwire/sent"
SESSION = "/wheelwire/session"
TOPICS = (RECEIVED, SENT, SESSION)

TOPIC_BY_KIND = {Kind.RECEIVED: RECEIVED, Kind.RECEIVED_EACH: RECEIVED, Kind.SENT: SENT}
"""The channels of these records; all others are in `SESSION`."""
# No dimension, no offset, the number of bytes; then of the bytes: number, kind, host_us.
_LAYOUT = struct.Struct("<4s3IQBq")
_RECORD_SIZE = struct.calcsize("<QBq")


def encode(record: Record) -> bytes:
    """The message of a record."""
    size = _RECORD_SIZE + len(record.data)
    head = _LAYOUT.pack(HEADER, 0, 0, size, record.number, record.kind, record.host_us)
    return head + record.data


def decode(message: bytes) -> Record:
    """The record of a message.

    Raises:
        ValueError: The message is of another release.
    """
    try:
        header, dimensions, offset, size, number, kind, host_us = _LAYOUT.unpack_from(message)
    except struct.error as error:
        raise ValueError(f"a message of {len(message)} bytes holds no record") from error
    data = message[_LAYOUT.size :]
    if (header, dimensions, offset, size) != (HEADER, 0, 0, _RECORD_SIZE + len(data)):
        raise ValueError("the recording is of another release: a message holds no record")
    return Record(number, Kind(kind), host_us, data)
