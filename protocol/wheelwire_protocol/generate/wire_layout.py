"""The wire layout as text, and its hash."""

from __future__ import annotations

import enum
import hashlib

from ..codes import ENUMERATIONS, FLAGS
from ..messages import MESSAGES
from ..parameters import PARAMETERS


def wire_layout() -> str:
    """The layout as text: all that must agree between host and device, and no prose."""
    lines = [
        f"{m.id} {m.name} " + " ".join(f"{f.name}:{f.format}" for f in m.fields) for m in MESSAGES
    ]
    lines += [f"{p.id} {p.name} {p.kind.value} {p.unit.value}" for p in PARAMETERS]
    codes: tuple[type[enum.Enum], ...] = (*ENUMERATIONS, *FLAGS)
    lines += [f"{e.__name__} " + " ".join(f"{m.name}={m.value}" for m in e) for e in codes]
    return "\n".join(lines)


def layout_hash() -> int:
    """First four bytes of the SHA-256 of `wire_layout`, little-endian."""
    return int.from_bytes(hashlib.sha256(wire_layout().encode()).digest()[:4], "little")
