"""The newest sample of a driver, for the application to read, and the sum of all ticks.

Also feeds the iterators over all samples.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from ..errors import RequestTimeout, WheelwireError, afresh
from ..samples import WheelSample, tick_difference
from .clock import host_clock_us
from .latest_sensors import SensorQueues
from .sample_iterator import QUEUE_US, SampleIterator, SampleIterators
from .state_stream import Measurement
from .waiting import Notifier

ATTENTION_US = 200_000
"""A program that asked for a sample within this time is about to ask for the next."""
FRESH_US = 100_000
"""A sample that was not read within this time, or within two periods of a slower stream, is not
handed out any more: it says nothing about a device that has fallen silent since."""
SLOWEST_US = 2_000_000
"""No stream is so slow that a sample this old could be news: the link is lost by then."""
_PERIODS = 7
ITERATOR_WAIT_S = 1.0
"""Longest single wait of an iterator, which waits again for as long as the driver is open."""


class Latest(NamedTuple):
    """The newest sample, whether it was read or not."""

    sample: WheelSample
    age_s: float
    """Since the device measured it. [s]"""


class LatestSample:
    """One slot: the newest sample wins, and each is returned once.

    One thread at a time puts; any thread may take, even in a signal handler: nothing is locked.

    Attributes:
        now_us: The clock that samples are stamped with.
        queue_us: How long an iterator holds a sample for a slow reader, on that clock.
        wait_for: Waits for a sample, as `Notifier.wait_for`.
        changed: Wakes who waits for a sample.
        sensors: Passes on what sensors measure.
    """

    def __init__(self) -> None:
        self.now_us = host_clock_us
        self.queue_us = QUEUE_US
        self.changed = Notifier()
        self.sensors = SensorQueues()
        self.wait_for = self.changed.wait_for
        self.notify_all = self.changed.notify_all
        """Wakes all that wait for a sample."""
        # Filled and emptied by one call into C each, so that no lock is needed.
        self._unread: deque[Measurement] = deque(maxlen=1)
        self._current = False
        self._newest: Measurement | None = None
        self._periods_us: tuple[int, ...] = ()
        """Between the last samples, on the device's clock. Replaced as a whole."""
        self._ticks = (0, 0)
        self._failure: WheelwireError | None = None
        self._closed = False
        # As if long ago: the clock may be near zero just after the computer has started.
        self._asked_us = -ATTENTION_US
        self._iterators: SampleIterators[WheelSample] = SampleIterators()

    def put(self, measurement: Measurement) -> None:
        """Store a measurement; `notify_all` wakes those who wait for it."""
        state, newest = measurement.state, self._newest
        # A reset sets the counters back: the difference across it is unknown, and counts as none.
        if newest is None:
            self._ticks = state.left_ticks, state.right_ticks
        elif state.boot_id == newest.state.boot_id:
            left, right = self._ticks
            self._ticks = (
                left + tick_difference(state.left_ticks, newest.state.left_ticks),
                right + tick_difference(state.right_ticks, newest.state.right_ticks),
            )
        if newest is not None and newest.t_us < measurement.t_us:  # not across a reset
            self._periods_us = (*self._periods_us[-_PERIODS:], measurement.t_us - newest.t_us)
        self._newest = measurement
        self._unread.append(measurement)
        # After the ticks, which another thread reads as soon as it sees this.
        self._current = True
        if self._iterators.is_iterated:
            self._iterators.put(measurement.sample, measurement.arrived_us)

    def interrupt(self) -> None:
        """The link is interrupted: the last sample is no longer current, nor handed out."""
        self._current = False
        self._unread.clear()

    def fail(self, error: WheelwireError) -> None:
        """No further sample will come: raise `error` to everyone who asks from now on."""
        self._failure = error
        self._unread.clear()
        self._current = False
        of_iterators = None if self._closed else error
        self._iterators.end(of_iterators)
        self.sensors.end(of_iterators)
        self.changed.notify_all()

    def close(self) -> None:
        """The driver is about to be closed: iterators then end instead of failing."""
        self._closed = True

    def iterate(self) -> SampleIterator[WheelSample]:
        """All samples from now on."""
        iterator = self._iterators.iterate(self._wait_for, self.queue_us)
        if self._closed:  # whatever had failed before
            iterator.end(None)
        return iterator

    def iterate_sensor(self, group: str) -> SampleIterator[Any]:
        """All samples of a sensor, or all events, from now on."""
        return self.sensors.iterators[group].iterate(self._wait_for, self.queue_us)

    def take(self, timeout_s: float) -> WheelSample:
        """Return the newest sample not returned yet, waiting for one if necessary.

        Raises:
            RequestTimeout: None came in time.
            WheelwireError: None will come, for the reason given to `fail`.
        """
        taken: list[Measurement] = []

        def take() -> bool:
            if not taken:  # asked again after the wait: it must not take a second one
                taken.extend(self._take_fresh())
            return bool(taken)

        self._wait(timeout_s, take)
        if not taken:
            raise self.why_none(timeout_s)
        return taken[0].sample()

    def poll(self) -> WheelSample | None:
        """As `take`, without waiting: None when there is none yet."""
        self._asked_us = host_clock_us()
        for measurement in self._take_fresh():
            return measurement.sample()
        if self._failure is not None:
            raise afresh(self._failure)
        return None

    @property
    def latest(self) -> Latest | None:
        """The newest sample, also when it was read or the link is lost; None before the first."""
        newest = self._newest
        if newest is None:
            return None
        sample = newest.sample()
        return Latest(sample, max(0.0, self.now_us() / 1e6 - sample.stamp))

    @property
    def age_s(self) -> float | None:
        """Seconds since the newest sample arrived; None before the first."""
        newest = self._newest
        return None if newest is None else max(0, self.now_us() - newest.arrived_us) / 1e6

    def ticks(self, timeout_s: float) -> tuple[int, int]:
        """The unbounded tick counts of the newest sample, waiting for a current one.

        They start at the first sample's and continue across counter wraps and device resets.

        Raises:
            RequestTimeout: No current sample came in time.
            WheelwireError: None will come, for the reason given to `fail`.
        """
        self._wait(timeout_s, lambda: self._current)
        if not self._current:
            raise self.why_none(timeout_s)
        return self._ticks

    @property
    def is_iterated(self) -> bool:
        """Whether anyone wants every sample, not just the newest."""
        return self._iterators.is_iterated

    @property
    def is_current(self) -> bool:
        """A sample was measured since the last interruption."""
        return self._current

    def is_read(self, now_us: int) -> bool:
        """Whether anyone is reading: then the next sample is wanted without delay."""
        return (
            now_us < self._asked_us + ATTENTION_US or self.is_iterated or self.sensors.is_iterated
        )

    def _take_fresh(self) -> tuple[Measurement, ...]:
        """The unread sample, unless there is none or it is too old."""
        try:
            measurement = self._unread.popleft()  # another thread may have taken it
        except IndexError:
            return ()
        # By the shortest one: a sample that was lost makes no stream slow.
        period_us = min(self._periods_us, default=0)
        limit_us = max(FRESH_US, min(SLOWEST_US, 2 * period_us))
        return (measurement,) if self.now_us() <= measurement.arrived_us + limit_us else ()

    def _wait_for(self, ready: Callable[[], bool]) -> None:
        self.wait_for(ready, ITERATOR_WAIT_S)

    def _wait(self, timeout_s: float, ready: Callable[[], bool]) -> None:
        self._asked_us = host_clock_us()
        if not ready():
            self.wait_for(lambda: ready() or self._failure is not None, timeout_s)
            # Again: the wait may have been long, and its caller is about to ask for the next.
            self._asked_us = host_clock_us()

    def why_none(self, timeout_s: float) -> WheelwireError:
        """Why no sample came within `timeout_s`."""
        if self._failure is not None:
            return afresh(self._failure)
        return RequestTimeout(
            f"no sample came within {timeout_s:g} s: set a stream rate above zero, or allow more "
            "time"
        )
