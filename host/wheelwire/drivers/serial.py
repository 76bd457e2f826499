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
        stream_rate_hz: Rate of the samples; None leaves the device's rate unchanged. If no sample
            was read for 0.2 s, the next one of a fast stream may be 10 ms old.
        board_id: Accept only this board (`robot.info.device.board_id`, 12 hex digits), under any
            port name. `port` may then be glob patterns, separated by commas; all matching free
            ports are opened to ask which board is there.
        any_board: Whether to go on if the port leads to a different board after a reconnection.
            Without this, calls raise `WrongBoard` until the first board is back.
        tap: Whether this user's other programs on this computer may look, stop and e-stop.
        board: What the device must be wired to: a built-in board's name, a board's file, or a
            description. A device on another board is not driven: opening it raises `BoardMismatch`,
            and so does every call if it reconnects like that. None: any confirmed board.
        parameters: Values, by name, that the device gets whenever a session opens. It does not save
            them.

    Raises:
        InvalidArgument: One of these is of a wrong type or size.
        PortUnavailable: The port cannot be opened, or the board is at none.
        ConfigurationError: `board` is not a board.
        BoardMismatch: The device is on another board.
        WheelwireError: As `TransportDriver`.
    """

    @takes(SerialDriverOptions)
    def __init__(self, options: SerialDriverOptions) -> None:
        super().__init__(partial(Link, options.checked()))
