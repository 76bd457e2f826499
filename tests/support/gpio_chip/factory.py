"""gpiozero's mock pins, wired to the chip: chosen by GPIOZERO_PIN_FACTORY=chip."""

from __future__ import annotations

import os
import socket
import threading
import time
from typing import Any

from gpiozero import PinFixedPull
from gpiozero.pins.mock import MockFactory, MockPWMPin

from support.gpio_chip.chip import EVENT, SOCKET

GATE = "WHEELWIRE_TEST_GATE"
"""A file that the guard of a pin process, which leads its session, waits for."""
READ_SIZE = EVENT.size * 256


class ChipFactory(MockFactory):  # type: ignore[misc]
    """One owner of lines; ends with its process."""

    def __init__(self) -> None:
        super().__init__(pin_class=ChipPin)
        gate = os.environ.get(GATE)
        while gate and os.getsid(0) == os.getpid() and not os.path.exists(gate):  # noqa: PTH110
            time.sleep(0.005)
        self._lock = threading.Lock()
        self._commands = _connect("commands")
        self._answers = self._commands.makefile("r")
        self._events: socket.socket | None = None

    def tell(self, line: str) -> None:
        with self._lock:
            self._commands.sendall(f"{line}\n".encode())

    def ask(self, line: str) -> str:
        with self._lock:
            self._commands.sendall(f"{line}\n".encode())
            return self._answers.readline().strip()

    def listen(self) -> None:
        """Events from now on, as lgpio's thread takes them from a pipe."""
        if self._events is None:
            self._events = _connect("events")
            threading.Thread(target=self._take_events, daemon=True).start()

    def _take_events(self) -> None:
        assert self._events
        rest = b""
        while data := self._events.recv(READ_SIZE):
            rest += data
            whole = len(rest) // EVENT.size * EVENT.size
            for _, gpio, level in EVENT.iter_unpack(rest[:whole]):
                self.pin(gpio).wire(level)
            rest = rest[whole:]


class ChipPin(MockPWMPin):  # type: ignore[misc]
    """An input: its level is the wire's, whatever the pull."""

    def _set_function(self, value: str) -> None:
        answer = self.factory.ask(f"claim {self._number} {value}")
        if answer == "busy":
            raise OSError(f"GPIO{self._number}: GPIO busy")
        super()._set_function(value)
        if value == "input":
            self._state: float = bool(int(answer))

    def _set_state(self, value: float) -> None:
        super()._set_state(value)
        self.factory.tell(f"set {self._number} {float(value)}")

    def _set_pull(self, value: str) -> None:
        if self.info.pull not in (value, ""):
            raise PinFixedPull(f"{self!r} has a physical pull-{self.info.pull} resistor")
        self._pull = value
        # An ioctl is done when it returns: no program sees the chip before it has the pull.
        self.factory.ask(f"pull {self._number} {value}")

    def _set_when_changed(self, value: Any) -> None:
        if value is not None:
            self.factory.listen()
        super()._set_when_changed(value)

    def close(self) -> None:
        super().close()
        self.factory.tell(f"free {self._number}")

    def wire(self, level: int) -> None:
        """Set the level that the connected hardware drives."""
        if self.function == "input":
            (self.drive_high if level else self.drive_low)()


def _connect(purpose: str) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(os.environ[SOCKET])
    connection.sendall(f"{purpose}\n".encode())
    return connection
