"""The wire layout of each group of messages as text, and its hash."""

from __future__ import annotations

import enum
import hashlib
from collections.abc import Iterable

from .. import board, sensors
from ..codes import ENUMERATIONS, FLAGS, RECORDER_CODES, Chip, Group
from ..messages import MESSAGES
from ..parameters import PARAMETERS

CODES: dict[Group, tuple[type[enum.Enum], ...]] = {
    Group.BASE: (*ENUMERATIONS, *FLAGS),
    Group.CONFIGURATION: (*board.CODES, *sensors.PERIPHERAL_CODES, sensors.PeripheralFlag),
    Group.RECORDER: RECORDER_CODES,
    Group.SENSOR: (*sensors.CODES, *sensors.FLAGS),
}
# A new group is no change of BASE, or each would part all hosts from all devices before it.
_GROUPS_OF_BASE = (Group.BASE, Group.CONFIGURATION)
# The hash covers these names: devices in the field have it with this one.
_LAYOUT_NAMES: dict[type[enum.Enum], str] = {Chip: "Board"}


def wire_layout(group: Group = Group.BASE) -> str:
    """The layout as text: all that must agree between host and device, and no prose."""
    lines = [
        f"{m.id} {m.name} " + " ".join(f"{f.name}:{f.format}" for f in m.fields)
        for m in MESSAGES
        if m.group is group
    ]
    if group is Group.BASE:
        lines += [f"{p.id} {p.name} {p.kind.value} {p.unit.value}" for p in PARAMETERS]
    lines += [
        f"{_LAYOUT_NAMES.get(e, e.__name__)} "
        + " ".join(f"{m.name}={m.value}" for m in _members(e))
        for e in CODES.get(group, ())
    ]
    return "\n".join(lines)


def _members(codes: type[enum.Enum]) -> Iterable[enum.Enum]:
    return _GROUPS_OF_BASE if codes is Group else codes


def layout_hash(group: Group = Group.BASE) -> int:
    """First four bytes of the SHA-256 of `wire_layout`, little-endian."""
    return int.from_bytes(hashlib.sha256(wire_layout(group).encode()).digest()[:4], "little")
