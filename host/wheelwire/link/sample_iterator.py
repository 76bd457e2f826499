"""All samples of a driver, one after the other: `for sample in robot.samples():`."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Generic, Protocol, TypeVar

from ..errors import WheelwireError

Sample = TypeVar("Sample")
Sample_co = TypeVar("Sample_co", covariant=True)


class Measured(Protocol[Sample_co]):
    """What becomes a sample when somebody asks for it."""

    @property
    def arrived_us(self) -> int:
        """The host's clock at the arrival, in us."""

    def sample(self) -> Sample_co:
        """The sample."""


QUEUE_US = 1_000_000
"""Samples that came longer than this before the newest are dropped."""


class SampleIterator(Generic[Sample]):
    """Each sample once, in order, from the moment at which the iterator was made.

    Its queue is its own and holds one second of samples: when whoever iterates is slower, the
    oldest are dropped and counted. It waits as long as the robot is out of reach, and ends when the
    driver is closed.

    Attributes:
        dropped: Samples that were not taken in time.
    """

    def __init__(
        self, wait: Callable[[Callable[[], bool]], None], queue_us: int = QUEUE_US
    ) -> None:
        """`wait` waits until its argument holds, or for a bounded time; see `BaseDriver`."""
        self.dropped = 0
        self._wait = wait
        self._queue_us = queue_us
        # Each in a list of its own: whoever takes it out of that has it, though another thread may
        # be about to do the same.
        self._queue: deque[list[Measured[Sample]]] = deque()
        self._over = False
        self._failure: WheelwireError | None = None

    def put(self, measurement: Measured[Sample]) -> None:
        """Add a measurement. Only one thread calls it."""
        queue = self._queue
        queue.append([measurement])
        with suppress(IndexError):  # whoever iterates was quicker
            # By time, not by number: the stream rate is the device's.
            while (oldest := queue[0])[0].arrived_us < measurement.arrived_us - self._queue_us:
                oldest.pop()
                self.dropped += 1
                with suppress(ValueError):  # whoever iterates has just passed over it
                    queue.remove(oldest)

    def end(self, failure: WheelwireError | None) -> None:
        """No sample will come any more: because the driver is closed, or for `failure`."""
        # First: whoever sees that it is over looks for the reason at once.
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
            self._wait(self.is_ready)

    def poll(self) -> Sample | None:
        """As `next`, without waiting: None when there is no sample yet."""
        over = self._over  # first: what came before the end is still handed out
        while self._queue:
            with suppress(IndexError):  # it was dropped meanwhile
                return self._queue.popleft().pop().sample()
        if not over:
            return None
        if self._failure is not None:
            raise self._failure.with_traceback(None)
        raise StopIteration

    def is_ready(self) -> bool:
        """Whether `poll` would return a sample, or raise."""
        return bool(self._queue) or self._over
