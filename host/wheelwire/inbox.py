"""Where a driver's samples wait for the application: the newest one, and the ticks of all."""

from __future__ import annotations

import threading
from collections.abc import Callable

from .clock import host_clock_us
from .errors import RequestTimeout, WheelwireError
from .samples import WheelSample

ATTENTION_US = 200_000
"""Whoever asked for a sample this lately is about to ask for the next."""


class SampleInbox:
    """One slot, the newest sample wins, each is handed out once. Safe between threads."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._last: WheelSample | None = None
        self._unread: WheelSample | None = None
        self._current = False
        self._left = 0
        self._right = 0
        self._failure: WheelwireError | None = None
        self._asked_us = -ATTENTION_US

    def put(self, sample: WheelSample) -> None:
        """A new sample was measured."""
        with self._changed:
            if self._last is None:
                self._left, self._right = sample.left_ticks, sample.right_ticks
            else:
                travel = sample.since(self._last)
                self._left += travel.left
                self._right += travel.right
            self._last = self._unread = sample
            self._current = True
            self._changed.notify_all()

    def interrupt(self) -> None:
        """The source is interrupted: what was measured until now is no longer current."""
        with self._changed:
            self._current = False

    def fail(self, error: WheelwireError) -> None:
        """No sample will come any more: whoever asks from now on gets `error`."""
        with self._changed:
            self._failure = error
            self._unread = None
            self._current = False
            self._changed.notify_all()

    def take(self, timeout_s: float) -> WheelSample:
        """The newest sample not handed out yet, waiting for one if need be.

        Raises:
            RequestTimeout: None came in time.
            WheelwireError: None will come, for the reason given to `fail`.
        """
        with self._changed:
            self._wait(timeout_s, lambda: self._unread is not None)
            sample, self._unread = self._unread, None
            if sample is None:
                raise self._why_none(timeout_s)
            return sample

    def ticks(self, timeout_s: float) -> tuple[int, int]:
        """The unbounded tick counts of the newest sample, waiting for a current one.

        They begin at the first sample's and go on across counter wraps and device resets.

        Raises:
            RequestTimeout: No current sample came in time.
            WheelwireError: None will come, for the reason given to `fail`.
        """
        with self._changed:
            self._wait(timeout_s, lambda: self._current)
            if not self._current:
                raise self._why_none(timeout_s)
            return self._left, self._right

    def is_read(self, now_us: int) -> bool:
        """Somebody asks for samples: the next one is worth having at once."""
        return now_us < self._asked_us + ATTENTION_US

    def _wait(self, timeout_s: float, ready: Callable[[], bool]) -> None:
        self._asked_us = host_clock_us()
        if not ready():
            self._changed.wait_for(lambda: ready() or self._failure is not None, timeout_s)
            self._asked_us = host_clock_us()

    def _why_none(self, timeout_s: float) -> WheelwireError:
        if self._failure is not None:
            return self._failure.with_traceback(None)
        return RequestTimeout(
            f"no sample came within {timeout_s:g} s: is the stream rate above zero?"
        )
