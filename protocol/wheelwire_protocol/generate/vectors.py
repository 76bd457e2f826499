"""vectors/generated.json: frames of every message, for all languages to encode and to decode.

Built with plain construct, not with the fast path, so that the vectors test the latter, too.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from typing import Any

from cobs import cobs

from ..codes import Unit
from ..message import Field, Message
from ..messages import MESSAGES
from ..reference import build_payload
from .text import banner

Values = dict[str, int | float | bytes]

_MAX_FLOAT = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]

_TYPICAL: dict[Unit, int | float] = {
    Unit.TICK: -1440,
    Unit.MICROSECOND: 1_500_000,
    Unit.SECOND: 1.5,
    Unit.METRE_PER_SECOND: 0.25,
    Unit.MILLIMETRE: 850,
    Unit.MILLIMETRE_PER_SECOND: 300,
    Unit.DUTY_Q15: -16_384,
    Unit.HERTZ: 100,
    Unit.NANOSECOND: 1000,
    Unit.MILLIVOLT: 11_800,
    Unit.MILLIAMPERE: -850,
    Unit.MILLIAMPERE_HOUR: 420.5,
    Unit.CENTIDEGREE_CELSIUS: 2534,
    Unit.RADIAN_PER_SECOND: 0.0625,
    Unit.METRE_PER_SECOND_SQUARED: 0.125,
    Unit.COUNT: -300,
}


def _limits(field: Field) -> tuple[int | float | bytes, int | float | bytes]:
    if field.is_text:
        return bytes(field.subcon.length), b"\xff" * field.subcon.length
    if field.format == "f":
        return -_MAX_FLOAT, _MAX_FLOAT
    bits = 8 * struct.calcsize("<" + field.format)
    return (0, 2**bits - 1) if field.format.isupper() else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


def _typical(field: Field) -> int | float | bytes:
    if field.is_text:
        return b"Wheelwire".ljust(field.subcon.length, b"\0")
    if field.unit is not Unit.NONE:
        typical = _TYPICAL[field.unit]
        # A field of 16 bits holds no second and a half.
        return typical if field.format == "f" else min(int(typical), _limits(field)[1])
    if field.enumeration:
        return int(max(field.enumeration))
    return 0.5 if field.format == "f" else 7


def _each(value: Callable[[Field], int | float | bytes]) -> Callable[[Message], Values]:
    return lambda message: {field.name: value(field) for field in message.fields}


def _bytes(pattern: Callable[[int], bytes]) -> Callable[[Message], Values]:
    """The body whose bytes are a pattern: any finite binary32 is exact in JSON and in C++."""

    def values(message: Message) -> Values:
        body = struct.unpack("<" + message.body_format, pattern(message.body_size))
        return dict(zip((field.name for field in message.fields), body, strict=True))

    return values


_CASES: tuple[tuple[str, int, Callable[[Message], Values]], ...] = (
    ("zeros", 0, _bytes(bytes)),
    ("typical", 1, _each(_typical)),
    ("least", 0x00FF, _each(lambda field: _limits(field)[0])),
    ("greatest", 0xFFFF, _each(lambda field: _limits(field)[1])),
    ("every byte another", 0x0201, _bytes(lambda size: bytes(range(1, size + 1)))),
    ("every other byte zero", 0xFF00, _bytes(lambda size: (b"\x00\xff" * size)[:size])),
)
"""Name, sequence number and values of the vectors of each message."""


def _vector(message: Message, name: str, seq: int, values: Values) -> dict[str, Any]:
    payload = build_payload(message, seq, values)
    return {
        "name": name,
        "message": message.name,
        "seq": seq,
        "fields": {n: v.hex() if isinstance(v, bytes) else v for n, v in values.items()},
        "payload": payload.hex(),
        "frame": (b"\x00" + cobs.encode(payload) + b"\x00").hex(),
    }


def generate() -> str:
    """The text of `generated.json`: one vector a line."""
    vectors = [
        _vector(message, name, seq, values(message))
        for message in MESSAGES
        for name, seq, values in _CASES
    ]
    about = banner("Vectors")
    rows = ",\n".join(f"  {json.dumps(vector)}" for vector in vectors)
    return f'{{\n "about": {json.dumps(about)},\n "frames": [\n{rows}\n ]\n}}\n'
