"""A host that writes a list of peripherals, to firmware in virtual time."""

from __future__ import annotations

import struct
import zlib

from support.raw import RawHost
from wheelwire_protocol.sensors import MOST_PERIPHERALS, PERIPHERAL_FORMAT
from wheelwire_protocol.types import (
    LAYOUTS,
    Ack,
    PeripheralGet,
    PeripheralsConfirm,
    PeripheralSet,
    PeripheralsWrite,
    PeripheralValue,
    Restart,
)

_HEAD_FIELDS = 3
"""Fields of a PeripheralSet before the entry: session, request, channel."""
_ENTRY = "<" + next(
    layout[_HEAD_FIELDS:] for _, message, layout in LAYOUTS if message is PeripheralSet
)


def entry(**fields: int) -> PeripheralSet:
    """An entry with these fields, and nothing in the others."""
    nothing = dict.fromkeys(PeripheralSet._fields, 0) | {"pin_a": -1, "pin_b": -1, "pin_c": -1}
    return PeripheralSet(**(nothing | fields))


def _crc(entries: list[PeripheralSet], board: int) -> int:
    padded = entries + [entry()] * (MOST_PERIPHERALS - len(entries))
    packed = b"".join(struct.pack(_ENTRY, *one[_HEAD_FIELDS:]) for one in padded)
    return zlib.crc32(struct.pack("<BBHI", PERIPHERAL_FORMAT, len(entries), 0, board) + packed)


def write_list(host: RawHost, *entries: PeripheralSet) -> None:
    """Replace the list, restart, and confirm it; leaves a session that is open.

    Raises:
        ValueError: The device does not take it.
    """
    host.open()
    session, board = (
        host.session_id,
        host.ask(PeripheralGet(host.session_id, 1, 0), PeripheralValue).board,
    )
    for channel, one in enumerate(entries):
        host.ask(one._replace(session_id=session, request_id=2 + channel, channel=channel), Ack)
    crc = _crc(list(entries), board)
    host.ask(PeripheralsWrite(session, 20, len(entries), board, crc), Ack)
    host.ask(Restart(session, 21), Ack)
    host.run_ms(1000)
    host.open()
    host.ask(PeripheralsConfirm(host.session_id, 1, crc), Ack)
