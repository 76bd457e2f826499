"""The lines of the chip: their owners, their levels, and the listeners to their edges."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

SOCKET = "WHEELWIRE_TEST_CHIP"
"""The environment's variable that has the path of the chip's socket."""
EVENT = struct.Struct("<QII")
"""Time in nanoseconds, GPIO, level."""
BUSY = "busy"
CREDENTIALS = struct.Struct("iII")
"""Process, user and group at the other end of a socket."""


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
    """Serves its lines on a Unix socket. Calls `changed` whenever an output changes.

    Attributes:
        writer: Process that asked for something last.
    """

    def __init__(self, path: Path, changed: Callable[[], None]) -> None:
        self.writer = 0
        self.lines = [Line() for _ in range(28)]
        self._changed = changed
        self._lock = threading.Lock()
        self._listeners: list[socket.socket] = []
        self._server = socket.socket(socket.AF_UNIX)
        self._server.bind(str(path))
        self._server.listen()
        threading.Thread(target=self._accept, daemon=True).start()

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
                    self.writer = process
                    self._obey(connection, *line.split())
        with self._lock:
            if connection in self._listeners:
                self._listeners.remove(connection)
            for gpio in self.lines:
                if gpio.owner is connection:
                    gpio.owner = None
                    gpio.level = float(gpio.level > 0)
        connection.close()
        self._changed()

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
        self._changed()

    def _claim(self, gpio: Line, connection: socket.socket, function: str) -> str:
        with self._lock:
            if gpio.owner not in (None, connection):
                return BUSY
            gpio.owner = connection
            gpio.output = function == "output"
            return str(int(gpio.level > 0))
