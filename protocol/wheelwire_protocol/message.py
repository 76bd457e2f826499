"""What a message definition is made of: fields with a unit and a doc, over plain construct."""

from __future__ import annotations

import enum
import struct
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import construct

from .codes import Group, Unit

HEADER_SIZE = 3
CRC_SIZE = 4
"""What surrounds the body of every payload: `id u8, seq u16` before it, `crc u32` after it."""


class Field(construct.Renamed):  # type: ignore[misc]  # construct has no type information
    """One field of a message: a named construct with a unit and a doc.

    A field whose name, unit and codes say everything has no doc.

    Args:
        subcon: One of construct's little-endian numbers, or `Bytes`.
        name: Its name in every language.
        doc: What it means.
        codes: The enumeration behind a coded value.
        unit: Its unit.
    """

    def __init__(
        self,
        subcon: Any,
        name: str,
        doc: str = "",
        codes: type[enum.IntEnum] | type[enum.IntFlag] | None = None,
        *,
        unit: Unit = Unit.NONE,
    ) -> None:
        super().__init__(subcon, newname=name, newdocs=doc)
        self.unit = unit
        self.enumeration = codes

    @property
    def is_text(self) -> bool:
        """True for characters, filled up with zeros; the other values are numbers."""
        return isinstance(self.subcon, construct.Bytes)

    @property
    def format(self) -> str:
        """The `struct` format character(s) of the value, without byte order."""
        if self.is_text:
            return f"{self.subcon.length}s"
        # construct's own format begins with the byte order.
        return str(self.subcon.fmtstr[1:])


u8, i8 = partial(Field, construct.Int8ul), partial(Field, construct.Int8sl)
u16, i16 = partial(Field, construct.Int16ul), partial(Field, construct.Int16sl)
u32, i32 = partial(Field, construct.Int32ul), partial(Field, construct.Int32sl)
u64, f32 = partial(Field, construct.Int64ul), partial(Field, construct.Float32l)


def chars(size: int, name: str, doc: str = "") -> Field:
    """So many bytes."""
    return Field(construct.Bytes(size), name, doc)


@dataclass(frozen=True)
class Message:
    """One message: the construct of its body, and what is derived from it mechanically.

    Attributes:
        id: First byte of the payload. 0x01..0x7f from the host, 0x80..0xff from the device.
        name: Its name in every language.
        doc: What it means, in one paragraph.
        body: A construct `Struct` of `Field`s.
        frozen: The layout is the same in every protocol version.
        answer: Of a request that is answered by more than an Ack, the answer's name.
        reads: It changes nothing, so every program may send it to a robot that another one drives.
    """

    id: int
    name: str
    doc: str
    body: Any
    frozen: bool = False
    answer: str = ""
    reads: bool = False

    @cached_property
    def fields(self) -> tuple[Field, ...]:
        """The body's fields, in wire order."""
        return tuple(self.body.subcons)

    @cached_property
    def body_format(self) -> str:
        """The body as a `struct` format, without byte order."""
        return "".join(f.format for f in self.fields)

    @cached_property
    def body_size(self) -> int:
        """Bytes of the body."""
        return struct.calcsize("<" + self.body_format)

    @property
    def payload_size(self) -> int:
        """Bytes of the payload: header, body and CRC."""
        return HEADER_SIZE + self.body_size + CRC_SIZE

    @property
    def is_request(self) -> bool:
        """True when the host repeats it until it is answered."""
        return not self.from_device and any(field.name == "request_id" for field in self.fields)

    @property
    def group(self) -> Group:
        """What it belongs to, by its id; each group has a hash of its own."""
        sixteen = (self.id & 0x7F) // 16
        return Group(max(0, sixteen - 1))  # BASE has twice as many

    @property
    def from_device(self) -> bool:
        """True when the device sends it."""
        return self.id >= 0x80


def message(id_: int, name: str, doc: str, *fields: Field, **properties: Any) -> Message:
    """The message of these fields; `properties` are the other attributes of `Message`."""
    return Message(id_, name, doc, construct.Struct(*fields), **properties)
