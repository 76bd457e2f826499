"""The executable `hardware_robot`: the node of a robot, with any of Wheelwire's drivers."""

from __future__ import annotations

import signal
import sys
import threading
from inspect import signature
from itertools import pairwise
from typing import Any

import rclpy
from rclpy.exceptions import NotInitializedException, ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.signals import uninstall_signal_handlers

from wheelwire import (
    BaseDriver,
    Pins,
    RecordingError,
    SerialDriver,
    driver_names,
    open_driver,
)
from wheelwire.tools.files.board import checked_board

from .node import BaseRobotNode, Finalized
from .parameters import Setting
from .reader import sampling_rate_hz

CONNECT_TIMEOUT_S = 2.0
"""How long one attempt lasts: short, because a transition or the node's end may wait for it."""
FILE_OPTION = "--params-file"
NO_PIN = NO_CHIP = -1
PINS = {
    name: NO_PIN if pin.default is None else int(pin.default)
    for name, pin in signature(Pins).parameters.items()
}
"""The pins of the wiring guide."""


def _pin(name: str, default: int) -> Setting:
    doc = "l298n, pigpio: GPIO, BCM number."
    if default == NO_PIN:
        doc += f" {NO_PIN}: not fitted."
    return Setting(f"pins.{name}", default, doc, min(default, 0), 27)


# fmt: off
SETTINGS = (
    Setting("driver_type", "serial",
            f"The driver: {', '.join(driver_names())}."),
    Setting("port", "/dev/wheelwire", "serial: device path, or socket://host:port."),
    Setting("baud_rate", 921_600, "serial: the rate to try first; then the usual ones. [baud]",
            1200, 4_000_000),
    Setting("board_id", "", "serial: accept only this board, 12 hex digits; port may then be glob "
            "patterns, separated by commas."),
    Setting("any_board", False, "serial: continue with another board if one appears at the port."),
    Setting("board", "", "serial: drive only if the device is on this board: a built-in board's "
            "name, or a file. Empty: whichever was confirmed. l298n, pigpio: the pins and the "
            "sensors, in place of pins.*."),
    Setting("pwm_chip", NO_CHIP, f"l298n: N of /sys/class/pwm/pwmchipN. {NO_CHIP}: find it.",
            NO_CHIP, 99),
    Setting("pigpio_host", "localhost", "pigpio: the daemon's computer."),
    Setting("pigpio_port", 8888, "pigpio: the daemon's TCP port.", 1, 65_535),
    Setting("tap", True, "serial, l298n, pigpio: other programs on this computer may look, stop "
            "and e-stop beside the node."),
    Setting("replay_file", "", "replay: the recording."),
    Setting("replay_speed", 1.0, "replay: how much faster than recorded; 0: as fast as the node "
            "takes it, sample by sample.", 0.0, 1000.0),
    Setting("record", "", "Record the link to this file, or to a file in this folder. Empty: no "
            "recording."),
    *(_pin(name, default) for name, default in PINS.items()),
)
# fmt: on


class HardwareRobot(BaseRobotNode):
    """A robot with the driver that the parameter `driver_type` names; arguments as its base."""

    _first_board: tuple[str, str] | None = None
    """The port, and the board that was found there first."""

    def __init__(self, problem: str = "") -> None:
        super().__init__("hardware_robot", SETTINGS, problem)

    @property
    def driver_type(self) -> str:
        """The driver's name."""
        return str(self.setting("driver_type"))

    def open_driver(self) -> BaseDriver:
        """Open the driver with the options in the node's parameters.

        Within a session of the link another board is refused by the link itself. A node that was
        cleaned up and configured again holds on to its board as well.
        """
        record: str | None = self.setting("record") or None
        options = self._options()
        try:
            driver = open_driver(self.driver_type, record=record, **options)
        except RecordingError as error:
            if record is None:
                raise
            # A full disk may keep a robot from being recorded, not from being driven.
            self.get_logger().error(f"record: {error}; the robot is not recorded")
            driver = open_driver(self.driver_type, **options)
        if isinstance(driver, SerialDriver):
            self._first_board = self.setting("port"), driver.info.device.board_id
        return driver

    def _board_id(self) -> str | None:
        """The only board that is accepted, if there is one."""
        given: str = self.setting("board_id")
        if given or self.setting("any_board") or self._first_board is None:
            return given or None
        port, board_id = self._first_board
        # Another port means another robot.
        return board_id if port == self.setting("port") else None

    def _options(self) -> dict[str, Any]:
        rate_hz = sampling_rate_hz(self.setting("publish_rate"))
        # A core on this computer gets them before it starts, because some take effect only at a
        # start. A board on a line gets its own from the connection.
        local: dict[str, Any] = {"parameters": {**self.bridge.given, "stream_rate_hz": rate_hz}}
        if self.driver_type == "serial":
            return {
                "port": self.setting("port"),
                "baud_rate": self.setting("baud_rate"),
                "connect_timeout": CONNECT_TIMEOUT_S,
                "stream_rate_hz": rate_hz,
                "board_id": self._board_id(),
                "any_board": self.setting("any_board"),
                "board": self.setting("board") or None,
                "tap": self.setting("tap"),
            }
        if self.driver_type == "mock":
            return local
        if self.driver_type == "replay":
            return {"file": self.setting("replay_file"), "speed": self.setting("replay_speed")}
        local["tap"] = self.setting("tap")
        if self.driver_type == "l298n":
            chip = self.setting("pwm_chip")
            pwm_chip = None if chip == NO_CHIP else chip
            return {**local, "pins": self._pins(), "pwm_chip": pwm_chip}
        if self.driver_type == "pigpio":
            daemon = {"host": self.setting("pigpio_host"), "port": self.setting("pigpio_port")}
            return {**local, **daemon, "pins": self._pins()}
        # A driver of another package, whose options are not known here.
        return {}

    def _pins(self) -> Any:
        if board := self.setting("board"):
            return checked_board(board)
        numbers: dict[str, int] = {name: self.setting(f"pins.{name}") for name in PINS}
        return Pins(**{name: number for name, number in numbers.items() if number != NO_PIN})


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted; however it ends, the wheels stop first."""
    rclpy_has_signals = threading.Event()

    def interrupt(*_: object) -> None:
        # From then on rclpy ends its context. It calls this handler as well: an exception would
        # have this thread destroy the executors before rclpy has woken them all.
        if not rclpy_has_signals.is_set():
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    try:
        problem = _init(args)
        rclpy_has_signals.set()
        _run(problem)
    except (KeyboardInterrupt, ExternalShutdownException, Finalized):
        return
    except ParameterException as error:
        sys.exit(f"hardware_robot: {error}")
    except (RuntimeError, NotInitializedException):
        if rclpy.ok():
            raise
        # A signal between two of its steps ends rclpy's context, and the next step then fails.
    finally:
        rclpy.try_shutdown()


def _run(problem: str) -> None:
    node = None
    try:
        node = HardwareRobot(problem)
        node.spin()
    finally:
        # At a signal, a thread of rclpy wakes each executor, even one that is being destroyed
        # here: a segmentation fault. This waits until that thread has ended.
        uninstall_signal_handlers()
        if node is not None:
            node.close()


def _init(args: list[str] | None) -> str:
    """Initialise rclpy; returns why the parameter files cannot be read, or nothing.

    Without them the node starts nevertheless, to say so: it would only be restarted if it ended.
    """
    given = sys.argv if args is None else args
    try:
        rclpy.init(args=given)
    except RuntimeError as error:
        # Only the text tells this error from rclpy's others.
        if "params file" not in str(error):
            raise
        pairs = pairwise(["", *given])
        # Without `--params-file` and what follows it.
        rclpy.init(args=[one for before, one in pairs if FILE_OPTION not in (before, one)])
        return (
            f"{' '.join(str(error).split())}: a ROS parameter file has its values below `/**:` and "
            "`ros__parameters:`; a file for wheelwire.open_robot is different"
        )
    return ""


if __name__ == "__main__":
    main()
