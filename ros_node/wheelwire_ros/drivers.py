"""The driver that a node's parameters name, with its options."""

from __future__ import annotations

from typing import Any

from wheelwire import BaseDriver, Pins, RecordingError, SerialDriver, open_driver
from wheelwire.tools.files.board import checked_board

from .parameter_values import Get
from .parameters import NO_CHIP, NO_PIN, PINS
from .reader import sampling_rate_hz

CONNECT_TIMEOUT_S = 2.0
"""How long one attempt lasts: short, because a transition or the node's end may wait for it."""


class Drivers:
    """Opens a node's driver, again and again.

    Args:
        get: The node's settings.
        given: The robot's parameters that the user gave, by name.
        logger: The node's.
    """

    def __init__(self, get: Get, given: dict[str, float], logger: Any) -> None:
        self._get = get
        self._given = given
        self._log = logger
        self._first_board: tuple[str, str] | None = None
        """The port, and the board that was found there first."""

    def open(self) -> BaseDriver:
        """Open the driver with the options in the node's parameters.

        Within a session of the link another board is refused by the link itself. A node that was
        cleaned up and configured again holds on to its board as well.
        """
        name: str = self._get("driver_type")
        record, options = self._get("record"), self._options()
        try:
            driver = open_driver(name, record=record or None, **options)
        except RecordingError as error:
            if not record:
                raise
            # A full disk may keep a robot from being recorded, not from being driven.
            self._log.error(f"record: {error}; the robot is not recorded")
            driver = open_driver(name, **options)
        if isinstance(driver, SerialDriver):
            self._first_board = self._get("port"), driver.info.device.board_id
        return driver

    def _options(self) -> dict[str, Any]:
        get = self._get
        rate_hz = sampling_rate_hz(get("publish_rate"))
        # A core on this computer gets them before it starts, because some take effect only at a
        # start. A board on a line gets its own from the connection.
        local = {"parameters": {**self._given, "stream_rate_hz": rate_hz}}
        match get("driver_type"):
            case "serial":
                return {
                    **{name: get(name) for name in ("port", "baud_rate", "any_board", "tap")},
                    "connect_timeout": CONNECT_TIMEOUT_S,
                    "stream_rate_hz": rate_hz,
                    "board_id": self._board_id(),
                    "board": get("board") or None,
                }
            case "mock":
                return local
            case "replay":
                return {"file": get("replay_file"), "speed": get("replay_speed")}
            case "l298n":
                chip = None if get("pwm_chip") == NO_CHIP else get("pwm_chip")
                return {**local, "tap": get("tap"), "pins": self._pins(), "pwm_chip": chip}
            case "pigpio":
                daemon = {"host": get("pigpio_host"), "port": get("pigpio_port")}
                return {**local, "tap": get("tap"), "pins": self._pins(), **daemon}
        # A driver of another package, whose options are not known here.
        return {}

    def _board_id(self) -> str | None:
        """The only board that is accepted, if there is one."""
        given: str = self._get("board_id")
        if given or self._get("any_board") or self._first_board is None:
            return given or None
        port, board_id = self._first_board
        # Another port means another robot.
        return board_id if port == self._get("port") else None

    def _pins(self) -> Any:
        if board := self._get("board"):
            return checked_board(board)
        numbers: dict[str, int] = {name: self._get(f"pins.{name}") for name in PINS}
        return Pins(**{name: number for name, number in numbers.items() if number != NO_PIN})
