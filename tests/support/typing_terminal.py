"""A command in a terminal of its own, at whose keyboard a test sits."""

from __future__ import annotations

import fcntl
import os
import re
import signal
import struct
import subprocess
import termios
import threading
import time
from collections.abc import Mapping, Sequence

from .command import PROGRAM, TIMEOUT_S
from .waiting import PERIOD_S

REPEAT_S = 1 / 30
"""Period of a held key."""

LAST_OUTPUT_S = 5.0
"""For what a command printed before it ended to be read."""


def _in_a_session_of_its_own() -> None:
    """For `preexec_fn`: stdin becomes the controlling terminal, whose Ctrl-C is a signal."""
    os.setsid()
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


class TypingTerminal:
    """Runs `wheelwire` with `arguments` during a `with` block; killed at its end.

    Args:
        arguments: Of the command.
        program: Is run in place of it.
        kitty: The terminal has the kitty keyboard protocol; its flags are in `flags`.
        size: Columns and rows; None: not known to the terminal itself.
        environment: Added to this process's.
    """

    def __init__(
        self,
        *arguments: str,
        program: Sequence[str] = PROGRAM,
        kitty: bool = False,
        size: tuple[int, int] | None = None,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self._kitty = kitty
        self.flags = [0]
        """The stack of the protocol."""
        self.output = b""
        self._open = self._master, self._slave = [*os.openpty()]
        self.before = self.attributes()
        if size is not None:
            self.resize(*size)
        columns = {"COLUMNS": "100"} if size is None else {}
        self.process = subprocess.Popen(
            [*program, *arguments],
            stdin=self._slave,
            stdout=self._slave,
            stderr=self._slave,
            env={**os.environ, **columns, "TERM": "xterm", **(environment or {})},
            preexec_fn=_in_a_session_of_its_own,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def attributes(self) -> list[object]:
        """The terminal's settings."""
        return list(termios.tcgetattr(self._slave))

    def resize(self, columns: int, rows: int) -> None:
        """Change the window's size; its program gets SIGWINCH."""
        fcntl.ioctl(self._master, termios.TIOCSWINSZ, struct.pack("4H", rows, columns, 0, 0))

    def press(self, keys: bytes) -> None:
        os.write(self._master, keys)

    def hold(self, key: bytes, seconds: float) -> None:
        """Hold a key as a keyboard does: pressed, and repeated after half a second."""
        end = time.monotonic() + seconds
        self.press(key)
        time.sleep(min(0.5, seconds))
        while time.monotonic() < end:
            self.press(key)
            time.sleep(REPEAT_S)

    def wait_for(self, text: str, count: int = 1) -> None:
        """Wait until the command has printed `text`, `count` times."""

        end = time.monotonic() + TIMEOUT_S
        while self.output.count(text.encode()) < count:
            assert time.monotonic() < end, self.output
            if self.process.poll() is not None:
                end = min(end, time.monotonic() + LAST_OUTPUT_S)
            time.sleep(PERIOD_S)

    def wait(self) -> int:
        """Wait until the command ends; returns its exit code."""
        return self.process.wait(TIMEOUT_S)

    def hang_up(self) -> None:
        """Close the terminal's window."""
        while self._open:
            os.close(self._open.pop())

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        self.hang_up()

    def _read(self) -> None:
        try:
            while data := os.read(self._master, 4096):
                self.output += data
                if self._kitty:
                    self._answer(data)
        except OSError:
            return

    def _answer(self, data: bytes) -> None:
        for sequence in re.findall(rb"\x1b\[([?<>]\d*)u", data):
            kind, flags = sequence[:1], int(sequence[1:] or 0)
            if kind == b">":
                self.flags.append(flags)
            elif kind == b"<":
                self.flags.pop()
            else:
                os.write(self._master, b"\x1b[?%du" % self.flags[-1])

    def __enter__(self) -> TypingTerminal:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
