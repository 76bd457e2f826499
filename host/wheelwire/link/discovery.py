"""Finds one board among several ports: by the id that it reports, not by the port's name.

CP210x bridges of boards and of lidars have the same ids, commonly the same serial number, and
change names at every plugging. Opening a port asserts DTR, which stops a lidar: so only ports that
the caller names are opened, and only if no process uses them.
"""

from __future__ import annotations

import select
from collections.abc import Iterable
from contextlib import suppress
from glob import glob
from pathlib import Path

from wheelwire_protocol.codec import schema_hash
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import DeviceHello, Hello

from ..errors import LinkLost, PortUnavailable
from .clock import host_clock_us
from .ports import PSEUDO_TERMINALS, final_name, is_in_use
from .session import HELLO_PERIOD_US
from .transports import Transport, open_transport

NO_VERSION = 0
"""No release has this version. A device refuses such a hello, so it ends no session; but the answer
has its id."""
IDENTIFY_TIMEOUT_US = 1_000_000
"""Opening a port may reset an ESP32: it answers after its boot."""


def open_board(ports: str, board_id: str, baud_rate: int) -> Transport:
    """Open the port at which the board answers.

    Args:
        ports: Names or glob patterns, separated by commas.
        board_id: As in `DeviceInfo`: the chip's MAC address, 12 hex digits.
        baud_rate: Of the board.

    Raises:
        PortUnavailable: It answers at none of the ports that are free.
    """
    # Path.glob takes no absolute pattern.
    # A set, because a port that several patterns match can be opened only once.
    names = sorted({name for pattern in ports.split(",") for name in glob(pattern.strip())})  # noqa: PTH207
    asked = [_Asked(transport) for transport in _open_free(names, baud_rate)]
    found = None
    try:
        found = _first_answer(asked, board_id.lower())
    finally:
        for one in asked:
            if one.transport is not found:
                one.transport.close()
    if found is None:
        heard = any(one.board_id for one in asked)
        raise PortUnavailable(ports, _why_not(board_id, names, asked), is_other_board=heard)
    return found


class _Asked:
    """A port whose device is asked for its id."""

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.board_id = ""
        self._encoder = Encoder()
        self._decoder = Decoder()
        self._output = b""

    def ask(self) -> None:
        """Say hello, again."""
        # Behind what the port has not taken yet, or the hello would cut the one before it short.
        self._output += self._encoder.encode(Hello(0, NO_VERSION, schema_hash()))
        # `listen` finds out when the port is gone.
        with suppress(LinkLost):
            self._output = self._output[self.transport.write(self._output) :]

    def listen(self) -> bool:
        """Read what has come; False when the port is gone: it is readable, and nothing comes."""
        data = b""
        with suppress(LinkLost):
            data = self.transport.read()
        for message in self._decoder.feed(data):
            if isinstance(message, DeviceHello):
                self.board_id = f"{message.board_id:012x}"
        return bool(data)


def _why_not(board_id: str, names: list[str], asked: list[_Asked]) -> str:
    """The reason; an absent board, a silent one and one in use by others need different cures."""
    if not names:
        return f"board {board_id} is not there, nor any such port: plug it in"
    heard = [f"{one.board_id} at {one.transport.port}" for one in asked if one.board_id]
    silent = [one.transport.port for one in asked if not one.board_id]
    opened = {one.transport.port for one in asked}
    held = [name for name in names if name not in opened]
    found = []
    if heard:
        found.append(f"another board is there: {', '.join(heard)}")
    if silent:
        found.append(
            f"no board answers at {', '.join(silent)}: if it is there, check its power and that "
            "the firmware is flashed"
        )
    if held:
        found.append(
            f"{', '.join(held)} cannot be opened or is in use: end the program that uses it"
        )
    return f"board {board_id} was not found: {'; '.join(found)}"


def _open_free(names: list[str], baud_rate: int) -> Iterable[Transport]:
    for name in names:
        if _is_free(name):
            with suppress(PortUnavailable):
                yield open_transport(name, baud_rate)


def _is_free(name: str) -> bool:
    final = final_name(name)
    # The simulator of a device has its pseudo-terminal open, too. The port's lock shows if it is in
    # use.
    if final.startswith(PSEUDO_TERMINALS):
        return True
    # Check first that the name still exists: looking through all processes takes long.
    return Path(final).exists() and is_in_use(final) is not True


def _first_answer(asked: list[_Asked], board_id: str) -> Transport | None:
    poller = select.poll()
    by_descriptor = {one.transport.fileno(): one for one in asked}
    for descriptor in by_descriptor:
        poller.register(descriptor, select.POLLIN)
    now_us = due_us = host_clock_us()
    end_us = now_us + IDENTIFY_TIMEOUT_US
    # Stop early once all have answered: then none of them is the board.
    while now_us < end_us and any(not one.board_id for one in by_descriptor.values()):
        if now_us >= due_us:
            due_us = now_us + HELLO_PERIOD_US
            for one in by_descriptor.values():
                one.ask()
        for descriptor, _ in poller.poll((due_us - now_us) / 1000):
            if not by_descriptor[descriptor].listen():
                poller.unregister(descriptor)
                del by_descriptor[descriptor]
            elif by_descriptor[descriptor].board_id == board_id:
                return by_descriptor[descriptor].transport
        now_us = host_clock_us()
    return None
