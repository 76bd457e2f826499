"""Samples, from the state frame to the reader.

`StateStream` makes measurements of the frames: none twice, in order, on the host's clock as well.
`LatestSample` keeps the newest one for the application to read, adds up all ticks, and feeds the
iterators: `for sample in robot.samples():`. What sensors measure comes from `sensor_stream`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar
from weakref import ref

from wheelwire_protocol.codes import fault_flags, supervisor_state
from wheelwire_protocol.types import WheelState

from ..errors import RequestTimeout, WheelwireError, afresh
from ..samples import (
    EVENTS,
    IMU,
    INPUTS,
    POWER,
    RANGE,
    TICK_MODULUS,
    SensorEvent,
    WheelSample,
)
from . import LazyLogger
from .clock import ClockEstimator, Conversion, DeviceTime, host_clock_us
from .threads import Notifier

if TYPE_CHECKING:
    from .sensor_stream import Sensed

DUTY_SCALE = 32767


class Measurement:
    """A state frame, which becomes a sample when somebody asks for it.

    Most are replaced by the next one before anybody does: making the sample, above all its stamp,
    costs more than all that is done with the others.

    Attributes:
        state: The frame.
        t_us: The device's clock at the latch, 64 bits. [us]
        arrived_us: The host's clock at the arrival. [us]
        supervisor: The supervisor's state.
        faults: Latched faults.
    """

    __slots__ = ("_clock", "arrived_us", "faults", "state", "supervisor", "t_us")

    def __init__(self, state: WheelState, t_us: int, clock: Conversion, arrived_us: int) -> None:
        """`clock` is the estimate at the arrival.

        Raises:
            ValueError: A code in the frame means nothing.
        """
        self.state = state
        self.t_us = t_us
        self.arrived_us = arrived_us
        self.supervisor = supervisor_state(state.supervisor)
        self.faults = fault_flags(state.faults)
        self._clock = clock

    def sample(self) -> WheelSample:
        """The sample, with the stamp by the estimate at the arrival."""
        state = self.state
        host_us, error_us = self._clock.device_to_host(self.t_us)
        return WheelSample(
            boot_id=state.boot_id,
            t_us=self.t_us,
            left_ticks=state.left_ticks,
            right_ticks=state.right_ticks,
            left_mps=state.left_mps,
            right_mps=state.right_mps,
            left_duty=state.left_duty_q15 / DUTY_SCALE,
            right_duty=state.right_duty_q15 / DUTY_SCALE,
            command_seq=state.command_seq,
            state=self.supervisor,
            faults=self.faults,
            overruns=state.overruns,
            battery_v=state.battery_mv / 1000 if state.battery_mv else None,
            stamp=host_us / 1e6,
            stamp_error_s=error_us / 1e6,
        )


class StateStream:
    """The state frames of a link across its sessions: which are new, and when they were latched."""

    def __init__(self) -> None:
        self.stale = 0
        """Frames that were repeated, or older than the newest."""
        self.new = 0
        """Frames that were new."""
        self._boot_id: int | None = None
        self._time = DeviceTime()

    def snapshot(self) -> tuple[int | None, int, int]:
        """What `resume` takes: the newest frame's boot, and its latch by both clocks."""
        return self._boot_id, *self._time.snapshot()

    def resume(self, boot_id: int | None, t_us: int, host_us: int) -> None:
        """Go on behind the frame of a snapshot."""
        self._boot_id = boot_id
        self._time.resume(t_us, host_us)

    def newest(
        self, states: Iterable[WheelState], clock: ClockEstimator, now_us: int
    ) -> Measurement | None:
        """The newest of the state frames that came at `now_us`; None if none is new.

        The others are dropped: they arrived at the same time as the newest.

        Raises:
            ValueError: A code in it means nothing.
        """
        newest, time = None, self._time
        for state in states:
            boot_id = state.boot_id
            if boot_id != self._boot_id:
                time = DeviceTime()
            if time.follow(state.t_us, clock, now_us, newer=time is self._time):
                self._boot_id, self._time = boot_id, time
                self.new += 1
                newest = state
            else:  # the same latch time: a frame that the line has doubled
                self.stale += 1
        if newest is None:
            return None
        # The estimate of this moment: later exchanges must not move a sample that is made later.
        return Measurement(newest, time.t_us, clock.conversion, now_us)


# --- all samples, one after the other -------------------------------------------------------------

Sample = TypeVar("Sample")

QUEUE_US = 1_000_000
"""Samples that came longer than this before the newest are dropped."""


class SampleIterator(Generic[Sample]):
    """Each sample once, in order, from the time the iterator was made.

    It has its own queue, which holds one second of samples. If the reader is slower, the oldest are
    dropped and counted. It waits as long as the robot is out of reach, and ends when the driver is
    closed.

    Attributes:
        dropped: Samples that were not taken in time.
    """

    def __init__(
        self, wait: Callable[[Callable[[], bool], float], bool], queue_us: int = QUEUE_US
    ) -> None:
        """`wait` waits until its argument holds, for some seconds; returns whether it holds."""
        self.dropped = 0
        self._wait = wait
        self._queue_us = queue_us
        # Each in its own list. Two threads may try to pop it; the one that succeeds has the sample.
        self._queue: deque[list[tuple[Callable[[], Sample], int]]] = deque()
        self._over = False
        self._failure: WheelwireError | None = None

    def put(self, make: Callable[[], Sample], arrived_us: int) -> None:
        """Add a sample, which `make` makes when it is taken. Only one thread calls this."""
        queue = self._queue
        queue.append([(make, arrived_us)])
        try:  # not `suppress`, which is three calls of Python
            # By time, not by number: the stream rate is the device's.
            while (oldest := queue[0])[0][1] < arrived_us - self._queue_us:
                oldest.pop()
                self.dropped += 1
                with suppress(ValueError):  # the reader has just skipped it
                    queue.remove(oldest)
        except IndexError:  # the reader was quicker
            return

    def end(self, failure: WheelwireError | None) -> None:
        """No sample will come any more: because the driver is closed, or for `failure`."""
        # First: a reader that sees the end reads the reason at once.
        self._failure = failure
        self._over = True

    def __iter__(self) -> SampleIterator[Sample]:
        return self

    def __next__(self) -> Sample:
        """The next sample.

        Raises:
            StopIteration: The driver was closed.
            WheelwireError: The link has ended otherwise.
        """
        while True:
            sample = self.poll()
            if sample is not None:
                return sample
            self._wait(self.is_ready, ITERATOR_WAIT_S)  # as `wait`, without the call

    def poll(self) -> Sample | None:
        """As `next`, without waiting: None when there is no sample yet."""
        over = self._over  # first: what came before the end is still handed out
        while self._queue:
            try:
                make, _ = self._queue.popleft().pop()
            except IndexError:  # it was just dropped
                continue
            return make()
        if not over:
            return None
        if self._failure is not None:
            raise afresh(self._failure)
        raise StopIteration

    def wait(self, timeout_s: float) -> bool:
        """Wait until `is_ready`; returns whether it is."""
        return self._wait(self.is_ready, timeout_s)

    def is_ready(self) -> bool:
        """Whether `poll` would return a sample, or raise."""
        return bool(self._queue) or self._over


class SampleIterators(Generic[Sample]):
    """The iterators over one kind of samples.

    One thread at a time puts and ends; any thread may iterate.
    """

    def __init__(self) -> None:
        self.listed: list[ref[SampleIterator[Sample]]] = []
        """The iterators, the same list for good. Copied before iterating: others add to it."""
        self._failure: WheelwireError | None = None
        self._is_over = False

    @property
    def is_iterated(self) -> bool:
        """Whether anyone wants every sample without delay, not just the newest."""
        return bool(self.listed)

    def iterate(
        self, wait: Callable[[Callable[[], bool], float], bool], queue_us: int
    ) -> SampleIterator[Sample]:
        """All samples from now on; see `SampleIterator`."""
        iterator: SampleIterator[Sample] = SampleIterator(wait, queue_us)
        # Weakly: one that was abandoned in the middle of a loop is no longer filled.
        self.listed.append(ref(iterator))
        if self._is_over:  # possibly before it was listed
            iterator.end(self._failure)
        return iterator

    def put(self, make: Callable[[], Sample], arrived_us: int) -> None:
        """Pass on a sample; see `SampleIterator.put`."""
        for reference in tuple(self.listed):
            iterator = reference()
            if iterator is None:
                # Here alone: other threads only append.
                self.listed.remove(reference)
            else:
                iterator.put(make, arrived_us)

    def end(self, failure: WheelwireError | None) -> None:
        """As `SampleIterator.end`, of all that there are and will be."""
        self._failure = failure
        # Before the list is read: a new iterator is in the list, or sees this.
        self._is_over = True
        for reference in tuple(self.listed):
            iterator = reference()
            if iterator is not None:
                iterator.end(failure)


# --- fewer samples --------------------------------------------------------------------------------

EARLY = 0.125
"""Fraction of a period by which a sample may be early and still count as on time."""


class Pacer:
    """Passes samples at a given rate, measured by the clock that made them: not by their arrival.

    Args:
        rate_hz: The highest rate.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_us = 1e6 / rate_hz
        self._due_us = 0.0
        self._boot_id: int | None = None

    def is_due(self, t_us: int, boot_id: int) -> bool:
        """Whether a sample passes.

        Args:
            t_us: The device's clock at the measurement.
            boot_id: A new one means that this clock restarted.
        """
        if boot_id != self._boot_id:
            self._boot_id = boot_id
            self._due_us = t_us
        if t_us < self._due_us - EARLY * self._period_us:
            return False
        if t_us - self._due_us > self._period_us:
            self._due_us = t_us  # no burst after a gap
        # From the due time, not from the sample's: otherwise each late one would lower the rate.
        self._due_us += self._period_us
        return True


# --- iterators of the sensors' samples and events -------------------------------------------------

_LOG = LazyLogger("wheelwire.sensors")


class SensorQueues:
    """The iterators over the sensors of one driver.

    One thread at a time passes on; any thread may iterate.

    Attributes:
        iterators: Over the samples of each group.
    """

    def __init__(self) -> None:
        self.iterators: dict[str, SampleIterators[Any]] = {
            group: SampleIterators() for group in (IMU, POWER, INPUTS, RANGE, EVENTS)
        }

    @property
    def is_iterated(self) -> bool:
        """Whether anyone wants a sample without delay."""
        # A loop, not a generator: a link that rests asks at each pass.
        for iterators in self.iterators.values():  # noqa: SIM110
            if iterators.listed:
                return True
        return False

    def take(self, port: str, sensed: deque[Sensed]) -> None:
        """Pass on what has come, and log the events of the robot at this port."""
        while sensed:
            group, what, arrived_us = sensed.popleft()
            if isinstance(what, SensorEvent):
                self._pass_on_event(port, what, arrived_us)
            else:
                self.iterators[group].put(what.sample, arrived_us)

    def _pass_on_event(self, port: str, event: SensorEvent, arrived_us: int) -> None:
        log = _LOG.warning if event.is_warning else _LOG.info
        log("%s: %s", port, event.sentence)
        self.iterators[EVENTS].put(lambda: event, arrived_us)

    def end(self, failure: WheelwireError | None) -> None:
        """No sample will come any more: because the driver is closed, or for `failure`."""
        for iterators in self.iterators.values():
            iterators.end(failure)


# --- the newest sample, and the sum of all ticks --------------------------------------------------

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
        changed: Wakes the threads that wait for a sample.
        sensors: Passes on what sensors measure.
        iterators: The readers that want every sample, not just the newest; mostly empty.
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
        self.iterators: Sequence[object] = self._iterators.listed

    def put(self, measurement: Measurement) -> None:
        """Store a measurement; `notify_all` wakes the threads that wait for it."""
        state, newest = measurement.state, self._newest
        # A reset clears the counters. The ticks during it are unknown, and taken to be zero.
        if newest is None:
            self._ticks = state.left_ticks, state.right_ticks
        elif state.boot_id == newest.state.boot_id:
            left, right = self._ticks
            before, half = newest.state, TICK_MODULUS // 2
            # As `tick_difference`, without two calls at each state frame.
            self._ticks = (
                left + (state.left_ticks - before.left_ticks + half) % TICK_MODULUS - half,
                right + (state.right_ticks - before.right_ticks + half) % TICK_MODULUS - half,
            )
        if newest is not None and newest.t_us < measurement.t_us:  # not across a reset
            self._periods_us = (*self._periods_us[-_PERIODS:], measurement.t_us - newest.t_us)
        # Before the newest: who sees that one, and no unread one, knows that somebody has taken it.
        self._unread.append(measurement)
        self._newest = measurement
        # After the ticks, which another thread reads as soon as it sees this.
        self._current = True
        if self.iterators:
            self._iterators.put(measurement.sample, measurement.arrived_us)

    def interrupt(self) -> None:
        """The link is interrupted: the last sample is no longer current, nor handed out."""
        self._current = False
        self._unread.clear()

    def fail(self, error: WheelwireError) -> None:
        """No further sample will come: raise `error` in every call from now on."""
        of_iterators = None if self._closed else error
        # First: to whom `take` raises the error, the iterators have ended.
        self._iterators.end(of_iterators)
        self.sensors.end(of_iterators)
        self._failure = error
        self._unread.clear()
        self._current = False
        self.changed.notify_all()

    def close(self) -> None:
        """The driver is about to be closed: iterators then end instead of failing."""
        self._closed = True

    def iterate(self) -> SampleIterator[WheelSample]:
        """All samples from now on."""
        iterator = self._iterators.iterate(self.wait_for, self.queue_us)
        if self._closed:  # even if something failed before
            iterator.end(None)
        return iterator

    def iterate_sensor(self, group: str) -> SampleIterator[Any]:
        """All samples of a sensor, or all events, from now on."""
        return self.sensors.iterators[group].iterate(self.wait_for, self.queue_us)

    def take(self, timeout_s: float) -> WheelSample:
        """Return the newest sample not returned yet, waiting for one if necessary.

        Of several threads that wait, each gets the sample that comes.

        Raises:
            RequestTimeout: None came in time.
            WheelwireError: None will come, for the reason given to `fail`.
        """
        taken: list[Measurement] = []
        since_us = self.now_us()

        def take() -> bool:
            if not taken:  # asked again after the wait: it must not take a second one
                taken.extend(self._take_fresh(since_us))
            return bool(taken)

        self._wait(timeout_s, take)
        if not taken:
            raise self.why_none(timeout_s)
        return taken[0].sample()

    def poll(self, since_us: int | None = None) -> WheelSample | None:
        """As `take`, without waiting: None when there is none yet.

        Args:
            since_us: When its caller began to wait, if it does.
        """
        self._asked_us = host_clock_us()
        for measurement in self._take_fresh(since_us):
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
        return bool(self.iterators)

    @property
    def is_current(self) -> bool:
        """A sample was measured since the last interruption."""
        return self._current

    def is_read(self, now_us: int) -> bool:
        """Whether anyone is reading: then no sample should be old."""
        if now_us < self._asked_us + ATTENTION_US or self.changed.waiting or self.iterators:
            return True
        return self.sensors.is_iterated

    def _take_fresh(self, since_us: int | None) -> tuple[Measurement, ...]:
        """The unread sample, or one that another reader has taken since then; none too old."""
        newest = self._newest
        try:
            measurement = self._unread.popleft()
        except IndexError:
            if newest is None or since_us is None or not self._current:
                return ()
            if newest.arrived_us <= since_us:
                return ()
            measurement = newest
        # By the shortest one: a sample that was lost makes no stream slow.
        period_us = min(self._periods_us, default=0)
        limit_us = max(FRESH_US, min(SLOWEST_US, 2 * period_us))
        return (measurement,) if self.now_us() <= measurement.arrived_us + limit_us else ()

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
