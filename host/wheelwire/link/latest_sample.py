"""Where a driver's samples wait for the application: the newest one, and the ticks of all.

Iterators over all samples are given them from here.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from weakref import ref

from ..errors import RequestTimeout, WheelwireError
from ..samples import WheelSample
from .clock import host_clock_us
from .sample_iterator import SampleIterator
from .waiting import Notifier

ATTENTION_US = 200_000
"""Whoever asked for a sample this lately is about to ask for the next."""
ITERATOR_WAIT_S = 1.0
"""Between two looks of an iterator, at most: it waits for as long as the driver is open."""


class LatestSample:
    """One slot, the newest sample wins, each is handed out once.

    One thread at a time puts; any thread may take, also in a signal handler: nothing is locked.
    """

    def __init__(self) -> None:
        self._changed = Notifier()
        self._last: WheelSample | None = None
        self._unread: deque[WheelSample] = deque(maxlen=1)
        self._current = False
        self._ticks = (0, 0)
        self._failure: WheelwireError | None = None
        self._closed = False
        self._asked_us = -ATTENTION_US
        self._iterators: list[ref[SampleIterator]] = []
        """Copied before it is walked through: other threads add to it."""

    def put(self, sample: WheelSample) -> None:
        """A new sample was measured."""
        if self._last is None:
            self._ticks = sample.left_ticks, sample.right_ticks
        else:
            travel, (left, right) = sample.since(self._last), self._ticks
            self._ticks = left + travel.left, right + travel.right
        self._last = sample
        self._unread.append(sample)
        for reference in tuple(self._iterators):
            iterator = reference()
            if iterator is None:
                self._iterators.remove(reference)
            else:
                iterator.put(sample)
        self._current = True
        self._changed.notify_all()

    def interrupt(self) -> None:
        """The source is interrupted: what was measured until now is no longer current."""
        self._current = False

    def fail(self, error: WheelwireError) -> None:
        """No sample will come any more: whoever asks from now on gets `error`."""
        self._failure = error
        self._unread.clear()
        self._current = False
        for reference in tuple(self._iterators):
            iterator = reference()
            if iterator is not None:
                iterator.end(None if self._closed else error)
        self._changed.notify_all()

    def close(self) -> None:
        """The driver is about to be closed: then iterators end, and do not fail."""
        self._closed = True

    def iterate(self, wait: Callable[[Callable[[], bool]], None] | None = None) -> SampleIterator:
        """All samples from now on; `wait`: see `SampleIterator`."""
        iterator = SampleIterator(wait or self._wait_for)
        self._iterators.append(ref(iterator))
        if self._failure is not None:  # maybe before it was listed
            iterator.end(None if self._closed else self._failure)
        return iterator

    @property
    def is_iterated(self) -> bool:
        """Somebody wants every sample, not the newest only."""
        return bool(self._iterators)

    def take(self, timeout_s: float) -> WheelSample:
        """The newest sample not handed out yet, waiting for one if need be.

        Raises:
            RequestTimeout: None came in time.
            WheelwireError: None will come, for the reason given to `fail`.
        """
        taken: list[WheelSample] = []

        def take() -> bool:
            with suppress(IndexError):  # none, or another thread was quicker
                if not taken:
                    taken.append(self._unread.popleft())
            return bool(taken)

        self._wait(timeout_s, take)
        if not taken:
            raise self._why_none(timeout_s)
        return taken[0]

    def ticks(self, timeout_s: float) -> tuple[int, int]:
        """The unbounded tick counts of the newest sample, waiting for a current one.

        They begin at the first sample's and go on across counter wraps and device resets.

        Raises:
            RequestTimeout: No current sample came in time.
            WheelwireError: None will come, for the reason given to `fail`.
        """
        self._wait(timeout_s, lambda: self._current)
        if not self._current:
            raise self._why_none(timeout_s)
        return self._ticks

    @property
    def is_current(self) -> bool:
        """A sample was measured since the last interruption."""
        return self._current

    def is_read(self, now_us: int) -> bool:
        """Somebody asks for samples: the next one is worth having at once."""
        return now_us < self._asked_us + ATTENTION_US or self.is_iterated

    def _wait_for(self, ready: Callable[[], bool]) -> None:
        self._changed.wait_for(ready, ITERATOR_WAIT_S)

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
