"""The lines of the chip, with their owners, levels and listeners, and the robot behind them."""

from __future__ import annotations

import socket
import struct
import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from support.bare_robot import BareRobot
from support.gpio_chip.pwm_directory import PwmDirectory
from wheelwire.board import Configuration
from wheelwire.pi.gpio.base import PWM_CHANNEL

SOCKET = "WHEELWIRE_TEST_CHIP"
"""The environment's variable that has the path of the chip's socket."""
EVENT = struct.Struct("<QII")
"""Time in nanoseconds, GPIO, level."""
BUSY = "busy"
CREDENTIALS = struct.Struct("iII")
"""Process, user and group at the other end of a socket."""
PART = 64 * EVENT.size
"""What a listener takes in one piece."""


@dataclass
class Line:
    """One GPIO."""

    level: float = 0.0
    """An output's level; between 0 and 1 it is software PWM."""
    output: bool = False
    pull: str = ""
    """An input's pull, as it was last asked for."""
    owner: socket.socket | None = None


class Chip:
    """Serves its lines on a Unix socket, moves the robot as they say, and reports its edges."""

    def __init__(self, path: Path, pwm: PwmDirectory | None, board: Configuration) -> None:
        self.robot = BareRobot(board)
        self.lines = [Line() for _ in range(28)]
        self._pwm = pwm
        self._writer = 0
        """Process that asked for something last."""
        self._lock = threading.Lock()
        self._listeners: list[socket.socket] = []
        self._server = socket.socket(socket.AF_UNIX)
        self._server.bind(str(path))
        self._server.listen()
        threading.Thread(target=self._accept, daemon=True).start()

    def advance(self) -> None:
        """What happens each millisecond."""
        if self._pwm:
            self._pwm.export()
            self.apply_pins()
        edges = self.robot.advance()
        if not edges.size:
            return
        for gpio in self.robot.encoders:
            levels = edges["level"][edges["gpio"] == gpio]
            if levels.size:
                self.lines[gpio].level = float(levels[-1])
        data = edges.tobytes()
        for begin in range(0, len(data), PART):
            self.send(data[begin : begin + PART])

    def apply_pins(self) -> None:
        """Move the robot as the outputs' levels say."""
        self.robot.set_pins(self._duty, self._writer)

    def _duty(self, gpio: int) -> float:
        if self._pwm and gpio in PWM_CHANNEL:
            return self._pwm.duty(gpio)
        return self.lines[gpio].level

    def send(self, events: bytes) -> None:
        """Send edges to all listeners; those that a listener has no room for are lost."""
        with self._lock:
            for listener in self._listeners:
                with suppress(OSError):  # BlockingIOError is one
                    listener.send(events, socket.MSG_DONTWAIT)

    def _accept(self) -> None:
        while True:
            connection, _ = self._server.accept()
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        lines = connection.makefile("r")
        credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
        process = CREDENTIALS.unpack(credentials)[0]
        with suppress(OSError):
            if lines.readline() == "events\n":
                with self._lock:
                    self._listeners.append(connection)
                connection.recv(1)
            else:
                for line in lines:
                    self._writer = process
                    self._obey(connection, *line.split())
        with self._lock:
            if connection in self._listeners:
                self._listeners.remove(connection)
            for gpio in self.lines:
                if gpio.owner is connection:
                    gpio.owner = None
                    gpio.level = float(gpio.level > 0)
        connection.close()
        self.apply_pins()

    def _obey(self, connection: socket.socket, command: str, *arguments: str) -> None:
        gpio = self.lines[int(arguments[0])]
        if command == "claim":
            connection.sendall(f"{self._claim(gpio, connection, arguments[1])}\n".encode())
        elif gpio.owner is connection and command == "set":
            gpio.level = float(arguments[1])
        elif command == "pull":
            if gpio.owner is connection:
                gpio.pull = arguments[1]
            connection.sendall(b"\n")
        elif gpio.owner is connection and command == "free":
            gpio.owner, gpio.output, gpio.level = None, False, 0.0  # the pull-down's
        self.apply_pins()

    def _claim(self, gpio: Line, connection: socket.socket, function: str) -> str:
        with self._lock:
            if gpio.owner not in (None, connection):
                return BUSY
            gpio.owner = connection
            gpio.output = function == "output"
            return str(int(gpio.level > 0))
