"""The driver of a robot whose ESP32 is at the other end of a serial link."""

from __future__ import annotations

from functools import partial

from ..link.connection import Link
from ..robot.robot import Robot
from .options import SerialDriverOptions, takes


class SerialDriver(Robot):
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
        tap: Whether this user's other programs on this computer may look, stop and e-stop
            meanwhile.
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

    @takes(SerialDriverOptions)
    def __init__(self, options: SerialDriverOptions) -> None:
        super().__init__(partial(Link, options.checked()))
