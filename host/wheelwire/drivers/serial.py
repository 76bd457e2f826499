"""The driver of a robot whose ESP32 is at the other end of a serial link."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from ..arguments import flag, text, whole
from ..board import BoardDescription
from ..errors import InvalidArgument, shown
from ..link.base_link import CONNECT_TIMEOUT_S, LinkOptions
from ..link.connection import Link
from .transport_driver import DeviceDriver, link_options

DEFAULT_BAUD_RATE = 921_600
MAX_BAUD_RATE = 20_000_000
"""More than any adapter has."""


class SerialDriver(DeviceDriver):
    """A robot behind a serial port.

    Args:
        port: Device path, pyserial URL, `socket://host:port` or `unix:path`.
        baud_rate: Tried first; then the usual ones.
        connect_timeout: How long to look for the device. [s]
        stream_rate_hz: Rate of the samples; None leaves it as the device has it. When nobody has
            asked for 0.2 s, the next one of a fast stream may be 10 ms old.
        board_id: Only this board will do (`robot.info.device.board_id`, 12 hex digits), under
            whichever name it comes back. `port` may then be glob patterns, separated by commas;
            all free ports that they match are opened to ask who is there.
        any_board: Whether to go on with another board than the first, where the port leads to one
            after a reconnection. Without it that raises `WrongBoard`, until the first is back.
        board: What the device must be wired to: a built-in board's name, a board's file, or a
            description. A device that is on another board is not driven: opening it, and every
            call after it came back so, raises `BoardMismatch`. None: whichever is confirmed.
        parameters: Values that the device is given whenever a session opens, by name; it saves
            none of them.

    Raises:
        InvalidArgument: One of these is of a wrong type or size.
        PortUnavailable: The port cannot be opened, or the board is at none.
        ConfigurationError: `board` is no board.
        BoardMismatch: The device is on another board.
        WheelwireError: As `TransportDriver`.
    """

    def __init__(
        self,
        port: str,
        *,
        baud_rate: int = DEFAULT_BAUD_RATE,
        connect_timeout: float = CONNECT_TIMEOUT_S,
        stream_rate_hz: int | None = None,
        board_id: str | None = None,
        any_board: bool = False,
        board: str | Path | BoardDescription | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> None:
        options = serial_link(
            port,
            baud_rate=baud_rate,
            connect_timeout=connect_timeout,
            stream_rate_hz=stream_rate_hz,
            board_id=board_id,
            any_board=any_board,
            board=board,
            parameters=parameters,
        )
        super().__init__(partial(Link, options))


def serial_link(
    port: str,
    *,
    baud_rate: int = DEFAULT_BAUD_RATE,
    connect_timeout: float = CONNECT_TIMEOUT_S,
    stream_rate_hz: int | None = None,
    board_id: str | None = None,
    any_board: bool = False,
    board: str | Path | BoardDescription | None = None,
    parameters: Mapping[str, float] | None = None,
) -> LinkOptions:
    """The link of a `SerialDriver` with these arguments, checked."""
    return link_options(
        text("port", port, "/dev/ttyUSB0"),
        baud_rate=whole("baud_rate", baud_rate, 1, MAX_BAUD_RATE),
        connect_timeout=connect_timeout,
        stream_rate_hz=stream_rate_hz,
        board_id=None if board_id is None else _board_id(board_id),
        any_board=flag("any_board", any_board),
        board=board,
        parameters=parameters,
    )


def _board_id(value: str) -> str:
    if not isinstance(value, str) or not re.fullmatch("[0-9a-fA-F]{12}", value):
        raise InvalidArgument(
            f"board_id = {shown(value)}: give its 12 hex digits, as `wheelwire info` shows them"
        )
    # As `DeviceInfo` writes it: ids are compared as text.
    return value.lower()
