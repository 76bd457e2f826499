"""A host that writes a list of peripherals, to firmware in virtual time."""

from __future__ import annotations

import struct

from support.raw import RawHost
from wheelwire_protocol.codec import BOARD, BY_TYPE, assembled, fingerprint_of
from wheelwire_protocol.types import (
    LAYOUTS,
    Ack,
    BoardSet,
    ConfigurationConfirm,
    ConfigurationGet,
    ConfigurationValue,
    ConfigurationWrite,
    PeripheralSet,
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


def write_list(host: RawHost, *entries: PeripheralSet) -> None:
    """Replace the list, restart, and confirm it; leaves a session that is open.

    Raises:
        ValueError: The device does not take it.
    """
    host.open()
    session = host.session_id
    value = host.ask(ConfigurationGet(session, 1), ConfigurationValue)
    board = BY_TYPE[ConfigurationValue].pack_body(*value)[-BOARD.size :]
    host.ask(BoardSet(session, 2, *BOARD.unpack(board)), Ack)
    for channel, one in enumerate(entries):
        host.ask(one._replace(session_id=session, request_id=3 + channel, channel=channel), Ack)
    packed = [struct.pack(_ENTRY, *one[_HEAD_FIELDS:]) for one in entries]
    fingerprint = fingerprint_of(assembled(board, packed))
    host.ask(ConfigurationWrite(session, 20, len(entries), fingerprint), Ack)
    host.ask(Restart(session, 21), Ack)
    host.run_ms(1000)
    host.open()
    host.ask(ConfigurationConfirm(host.session_id, 1, fingerprint), Ack)
