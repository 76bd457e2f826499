"""What a message definition is made of: fields with a unit and a doc, over plain construct."""

from __future__ import annotations

import enum
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar

import construct

from .codes import Group, Unit

HEADER_SIZE = 3
CRC_SIZE = 4
"""What surrounds the body of every payload: `id u8, seq u16` before it, `crc u32` after it."""


class Field(construct.Renamed):  # type: ignore[misc]  # construct has no type information
    """One field of a message: a construct with a unit, a doc and, for codes, their enumeration.

    A field whose name, unit and codes say everything has no doc.

    Args:
        subcon: One of construct's little-endian numbers, or `Bytes`.
        doc: What it means.
        codes: Of a coded value, what it may be.
        unit: Of a number.
        name: By default that of the attribute of a `Definition`.
    """

    def __init__(
        self,
        subcon: Any,
        doc: str = "",
        codes: type[enum.IntEnum] | type[enum.IntFlag] | None = None,
        *,
        unit: Unit = Unit.NONE,
        name: str = "",
    ) -> None:
        super().__init__(subcon, newname=name, newdocs=doc)
        self.unit = unit
        self.enumeration = codes

    def __set_name__(self, _: type, name: str) -> None:
        self.name = name

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


def chars(size: int, doc: str = "") -> Field:
    """So many bytes."""
    return Field(construct.Bytes(size), doc)


@dataclass(frozen=True)
class Message:
    """One message, and what is derived from its fields mechanically.

    Attributes:
        id: First byte of the payload. 0x01..0x7f from the host, 0x80..0xff from the device.
        name: Its name in every language.
        doc: What it means, in one paragraph.
        fields: The body's, in wire order.
        frozen: The layout is the same in every protocol version.
        answer: Of a request that is answered by more than an Ack, the answer's name.
        reads: It changes nothing, so every program may send it to a robot that another one drives.
    """

    id: int
    name: str
    doc: str
    fields: tuple[Field, ...]
    frozen: bool = False
    answer: str = ""
    reads: bool = False

    @property
    def body(self) -> Any:
        """The construct of the body."""
        return construct.Struct(*self.fields)

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


class Definition:
    """A message, or what several have in common: its attributes are fields, in wire order.

    An attribute is one field, or a tuple of fields that have names. Those of a base come first. The
    keywords of a class are attributes of `Message`, for its subclasses, too; one that has an `id`
    is a message, of its name and doc.
    """

    message: ClassVar[Message]
    _keywords: ClassVar[dict[str, Any]] = {}

    def __init_subclass__(cls, **keywords: Any) -> None:
        cls._keywords = cls._keywords | keywords
        if "id" in keywords:
            doc = cls.__doc__ or ""
            cls.message = Message(
                name=cls.__name__, doc=doc, fields=fields_of(cls), **cls._keywords
            )


def fields_of(definition: type[Definition]) -> tuple[Field, ...]:
    """All fields of a definition, in wire order."""
    found: list[Field] = []
    for part in reversed(definition.__mro__):
        for value in vars(part).values():
            if isinstance(value, Field):
                found.append(value)
            elif isinstance(value, tuple):
                found += [one for one in value if isinstance(one, Field)]
    return tuple(found)


def messages_in(definitions: Iterable[Any]) -> tuple[Message, ...]:
    """The messages among these, in their order."""
    return tuple(
        one.message
        for one in definitions
        if isinstance(one, type) and issubclass(one, Definition) and "message" in vars(one)
    )
