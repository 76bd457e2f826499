"""The messages between a program that holds a port and one that is attached to it.

Each side begins with one byte, `VERSION`. Messages follow: length of the data (u32), kind (u8),
data. All numbers are little-endian.
"""

from __future__ import annotations

import enum
import json
import struct
from collections.abc import Iterable, Iterator
from typing import Any

from wheelwire_protocol.codes import Fault

from ... import errors
from ...link.traffic import Kind, Record

VERSION = bytes([1])

_HEADER = struct.Struct("<IB")
_RECORD = struct.Struct("<QBqI")
_TAG = struct.Struct("<I")


class Say(enum.IntEnum):
    """What a message says, and what its data is."""

    GREETING = 0
    """The program that holds the port, and the port: JSON."""
    STATUS = 1
    """How the link is: JSON. To each listener, once a second."""
    RECORDS = 2
    """What crossed the link: number (u64), kind (u8), host's clock (i64), length (u32), data."""
    LOST = 3
    """Records that were not taken in time: how many (u32). A new START follows."""
    ANSWER = 4
    """To ASK: its tag (u32), and the frame of the answer."""
    FAILURE = 5
    """To ASK: its tag (u32), and the error: JSON."""
    LISTEN = 16
    """The attached program wants RECORDS from now on, beginning with a START. Empty."""
    ASK = 17
    """The attached program's request: a tag of its own (u32), and the request's frame."""


def message(kind: Say, data: bytes = b"") -> bytes:
    """One message, encoded."""
    return _HEADER.pack(len(data), kind) + data


def tagged(kind: Say, tag: int, data: bytes) -> bytes:
    """A message with a tag, encoded."""
    return message(kind, _TAG.pack(tag) + data)


def take_tag(data: bytes) -> tuple[int, bytes]:
    """The tag of a message's data, and the rest.

    Raises:
        ValueError: It has none.
    """
    try:
        return _TAG.unpack_from(data)[0], data[_TAG.size :]
    except struct.error as error:
        raise ValueError(f"a message without its tag: {error}") from error


def encoded_records(records: Iterable[Record]) -> bytes:
    """The data of RECORDS."""
    pack = _RECORD.pack
    return b"".join(
        part
        for number, kind, host_us, data in records
        for part in (pack(number, kind, host_us, len(data)), data)
    )


def decoded_records(data: bytes) -> Iterator[Record]:
    """The records in the data of RECORDS.

    Raises:
        ValueError: It is damaged.
    """
    at = 0
    while at < len(data):
        try:
            number, kind, host_us, size = _RECORD.unpack_from(data, at)
        except struct.error as error:
            raise ValueError(f"a damaged record: {error}") from error
        at += _RECORD.size
        yield Record(number, Kind(kind), host_us, data[at : at + size])
        at += size


def encoded_error(error: errors.WheelwireError) -> bytes:
    """The data of FAILURE, without its tag."""
    plain = {k: int(v) if isinstance(v, int) else v for k, v in error.__dict__.items()}
    state = {key: value for key, value in plain.items() if isinstance(value, (int, str, tuple))}
    return json.dumps({"error": type(error).__name__, "says": str(error), "state": state}).encode()


def decoded_error(data: bytes) -> errors.WheelwireError:
    """The error in the data of FAILURE.

    Raises:
        ValueError: The data is not an error.
    """
    known = decoded_json(data)
    kind = getattr(errors, str(known.get("error")), None)
    if not (isinstance(kind, type) and issubclass(kind, errors.WheelwireError)):
        kind = errors.WheelwireError  # of another release
    # JSON has no tuples.
    state: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in dict(known.get("state", {})).items()
    }
    if "faults" in state:
        state["faults"] = Fault(state["faults"])
    return errors.rebuilt(kind, (str(known.get("says")),), state)


def decoded_json(data: bytes) -> dict[str, Any]:
    """The object in a message's data.

    Raises:
        ValueError: The data is not a JSON object.
    """
    known = json.loads(data)
    if isinstance(known, dict):
        return known
    raise ValueError("a message that is no JSON object")


class MessageReader:
    """Takes one side's bytes apart.

    Args:
        longest: Of a message's data; more is an error.
    """

    def __init__(self, longest: int) -> None:
        self._longest = longest
        self._data = bytearray()
        self._has_begun = False

    def feed(self, data: bytes) -> list[tuple[Say, bytes]]:
        """The messages that are complete by now.

        Raises:
            ValueError: The other side speaks another version, or nonsense.
        """
        self._data += data
        if self._data and not self._has_begun:
            if self._data[:1] != VERSION:
                raise ValueError(f"version {self._data[0]}, not {VERSION[0]}")
            del self._data[:1]
            self._has_begun = True
        found = []
        while len(self._data) >= _HEADER.size:
            length, kind = _HEADER.unpack_from(self._data)
            if length > self._longest:
                raise ValueError(f"a message of {length} bytes")
            end = _HEADER.size + length
            if len(self._data) < end:
                break
            found.append((Say(kind), bytes(self._data[_HEADER.size : end])))
            del self._data[:end]
        return found
