"""The wire layout of each group of messages as text, and its hash."""

from __future__ import annotations

import enum
import hashlib
from collections.abc import Iterable

from .. import board, peripherals, self_test
from ..codes import ENUMERATIONS, FLAGS, RECORDER_CODES, Chip, Failure, Group
from ..message import Message
from ..messages import MESSAGES
from ..parameters import PARAMETERS

CODES: dict[Group, tuple[type[enum.Enum], ...]] = {
    Group.BASE: (*ENUMERATIONS, *FLAGS),
    Group.CONFIGURATION: (*board.CODES, *peripherals.PERIPHERAL_CODES, peripherals.PeripheralFlag),
    Group.RECORDER: RECORDER_CODES,
    Group.SENSOR: (*peripherals.CODES, *peripherals.FLAGS),
}
# A new group leaves the hash of BASE as it is: older devices must still be usable.
_GROUPS_OF_BASE = (Group.BASE, Group.CONFIGURATION)
# The hash covers these names: devices in the field have it with this one.
_LAYOUT_NAMES: dict[type[enum.Enum], str] = {Chip: "Board"}


def wire_layout(group: Group = Group.BASE) -> str:
    """The layout as text: all that must agree between host and device, and no prose."""
    lines = _message_lines(m for m in MESSAGES if m.group is group)
    if group is Group.BASE:
        lines += [f"{p.id} {p.name} {p.kind.value} {p.unit.value}" for p in PARAMETERS]
    return "\n".join(lines + _code_lines(CODES.get(group, ())))


def self_test_layout() -> str:
    """As `wire_layout`, of the self-test's messages."""
    return "\n".join(_message_lines(self_test.MESSAGES) + _code_lines([Failure]))


def _message_lines(messages: Iterable[Message]) -> list[str]:
    return [
        f"{m.id} {m.name} " + " ".join(f"{f.name}:{f.format}" for f in m.fields) for m in messages
    ]


def _code_lines(codes: Iterable[type[enum.Enum]]) -> list[str]:
    return [
        f"{_LAYOUT_NAMES.get(e, e.__name__)} "
        + " ".join(f"{m.name}={m.value}" for m in _members(e))
        for e in codes
    ]


def _members(codes: type[enum.Enum]) -> Iterable[enum.Enum]:
    return _GROUPS_OF_BASE if codes is Group else codes


def layout_hash(group: Group = Group.BASE) -> int:
    """First four bytes of the SHA-256 of `wire_layout`, little-endian."""
    return _hash(wire_layout(group))


def self_test_hash() -> int:
    """As `layout_hash`, of the self-test's messages."""
    return _hash(self_test_layout())


def _hash(layout: str) -> int:
    return int.from_bytes(hashlib.sha256(layout.encode()).digest()[:4], "little")
