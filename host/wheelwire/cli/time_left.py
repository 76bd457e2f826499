"""A line at the end of a terminal that counts down while the wheels turn."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType

from rich.console import Console
from rich.status import Status
from rich.text import Text


class TimeLeft:
    """Shows how long the wheels still turn, and what part of that is over; a context manager.

    Where nobody watches, as in a file, it shows nothing.

    Args:
        console: What else is shown meanwhile has to go to it, too.
        now: Of a clock [s].
    """

    def __init__(self, console: Console, now: Callable[[], float] = time.monotonic) -> None:
        self._status = Status(self, console=console, spinner="line", refresh_per_second=4)
        self._is_shown = False
        self._is_watched = console.is_terminal
        self._now = now
        self._begin = 0.0
        self._end = 0.0

    def __enter__(self) -> TimeLeft:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.show(0.0)

    def show(self, left_s: float) -> None:
        """The wheels turn for about this long from now; 0: they stand, and the line goes."""
        now = self._now()
        if left_s <= 0.0:
            self._status.stop()
            self._is_shown = False
            return
        if not self._is_shown:
            self._begin = now
        self._end = now + left_s
        if self._is_watched and not self._is_shown:
            self._status.start()
        self._is_shown = True

    def __rich__(self) -> Text:
        """The line as it is now."""
        now = self._now()
        # What takes longer than expected is not over yet.
        left_s = max(1.0, self._end - now)
        done = (now - self._begin) / (now - self._begin + left_s)
        return Text(f"the wheels turn: {done:.0%} done, about {left_s:.0f} s left")
