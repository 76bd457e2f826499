"""The terminal: each key at once, releases where they are reported, and all of it undone."""

from __future__ import annotations

import os
import select
import termios
from contextlib import suppress
from typing import Any

from .keys import KeyboardFlags

_QUERY = b"\x1b[?u"
_WANTED = 0b1011
"""Unambiguous codes, event types, and both for keys that make text."""
_REPORTS_RELEASES = 0b1010
_PUSH = b"\x1b[>%du" % _WANTED
_POP = b"\x1b[<u"
_CLEAR_TO_END = "\x1b[K"
_READ_SIZE = 4096
_LFLAG, _IFLAG, _CC = 3, 0, 6


class Terminal:
    """A terminal that gives each key at once, during a `with` block.

    Args:
        keyboard: File descriptor of the terminal to read.
        screen: File descriptor to write to.

    Raises:
        termios.error: When entered: it is not a terminal.
    """

    def __init__(self, keyboard: int, screen: int) -> None:
        self._keyboard = keyboard
        self._screen = screen
        self._before: list[Any] = []
        self._pushed = False
        self._line = ""
        self.reports_releases = False
        """Whether the terminal has confirmed that it reports the release of keys."""

    def __enter__(self) -> Terminal:
        self._before = termios.tcgetattr(self._keyboard)
        # Read again, not copied: a copy would share the inner list of characters changed below.
        attributes = termios.tcgetattr(self._keyboard)
        attributes[_LFLAG] &= ~(termios.ICANON | termios.ECHO)
        attributes[_IFLAG] &= ~termios.IXON  # Ctrl-S would block the loop at its next output
        characters = attributes[_CC]
        characters[termios.VMIN], characters[termios.VTIME] = 1, 0
        # Ctrl-C stays a signal, which is heard while a call waits for the robot. Suspending or
        # quitting without cleaning up would leave the terminal as it is now: they become keys.
        disabled = bytes([os.fpathconf(self._keyboard, "PC_VDISABLE")])
        characters[termios.VSUSP] = characters[termios.VQUIT] = disabled
        termios.tcsetattr(self._keyboard, termios.TCSAFLUSH, attributes)
        # A terminal that does not know the protocol ignores the query.
        self._write(_QUERY)
        return self

    def __exit__(self, *_: object) -> None:
        try:
            with suppress(OSError):  # it may be gone
                self._write(_POP + b"\r\n" if self._pushed else b"\r\n")
        finally:
            with suppress(termios.error):
                # Drops what was typed until now, such as the release of the last key.
                termios.tcsetattr(self._keyboard, termios.TCSAFLUSH, self._before)

    def read(self, timeout: float) -> bytes | None:
        """What was typed, at most `timeout` later; empty if nothing was, None at the end."""
        ready, _, _ = select.select([self._keyboard], [], [], max(0.0, timeout))
        if not ready:
            return b""
        try:
            return os.read(self._keyboard, _READ_SIZE) or None
        except OSError:  # the other end of a pseudo-terminal was closed
            return None

    def take_flags(self, answer: KeyboardFlags) -> None:
        """Take the terminal's answer: ask for releases, then see whether they were granted."""
        if not self._pushed:
            # Any answer to the first query means that the terminal knows the protocol.
            self._pushed = True
            self._write(_PUSH + _QUERY)
        else:
            granted = answer.flags & _REPORTS_RELEASES == _REPORTS_RELEASES
            if granted and not self.reports_releases:
                self.say("this terminal reports releases: a released key stops at once")
            self.reports_releases = granted

    def show(self, line: str) -> None:
        """Show a line in place of the last one, cut to the terminal's width."""
        # A pseudo-terminal that was given no size says 0. The last column stays free: a character
        # there makes some terminals begin a new line.
        columns = os.get_terminal_size(self._screen).columns or 80
        line = line[: columns - 1]
        if line != self._line:
            self._line = line
            self._write(f"\r{line}{_CLEAR_TO_END}".encode(errors="replace"))

    def say(self, text: str) -> None:
        """Print a text of its own above the line."""
        # Forgotten, or `show` would take the line for one that is on the screen.
        line, self._line = self._line, ""
        self._write(f"\r{text}{_CLEAR_TO_END}\r\n".encode(errors="replace"))
        self.show(line)

    def _write(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._screen, data) :]
