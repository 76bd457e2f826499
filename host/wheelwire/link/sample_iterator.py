"""All samples of a driver, one after the other: `for sample in robot.samples():`."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Generic, TypeVar
from weakref import ref

from ..errors import WheelwireError, afresh

Sample = TypeVar("Sample")

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
        self._queue: deque[list[tuple[Callable[[], Sample], int]]] = deque()
        self._over = False
        self._failure: WheelwireError | None = None

    def put(self, make: Callable[[], Sample], arrived_us: int) -> None:
        """Add a sample, which `make` makes when it is taken. Only one thread calls this."""
        queue = self._queue
        queue.append([(make, arrived_us)])
        with suppress(IndexError):  # whoever iterates was quicker
            # By time, not by number: the stream rate is the device's.
            while (oldest := queue[0])[0][1] < arrived_us - self._queue_us:
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
                make, _ = self._queue.popleft().pop()
                return make()
        if not over:
            return None
        if self._failure is not None:
            raise afresh(self._failure)
        raise StopIteration

    def is_ready(self) -> bool:
        """Whether `poll` would return a sample, or raise."""
        return bool(self._queue) or self._over


class SampleIterators(Generic[Sample]):
    """The iterators over one kind of samples.

    One thread at a time puts and ends; any thread may iterate.
    """

    def __init__(self) -> None:
        self._iterators: list[ref[SampleIterator[Sample]]] = []
        """Copied before iterating: other threads add to it."""
        self._failure: WheelwireError | None = None
        self._is_over = False

    @property
    def is_iterated(self) -> bool:
        """Whether anyone wants every sample without delay, not just the newest."""
        return bool(self._iterators)

    def iterate(
        self, wait: Callable[[Callable[[], bool]], None], queue_us: int
    ) -> SampleIterator[Sample]:
        """All samples from now on; see `SampleIterator`."""
        iterator: SampleIterator[Sample] = SampleIterator(wait, queue_us)
        # Weakly: one that was abandoned in the middle of a loop is no longer filled.
        self._iterators.append(ref(iterator))
        if self._is_over:  # possibly before it was listed
            iterator.end(self._failure)
        return iterator

    def put(self, make: Callable[[], Sample], arrived_us: int) -> None:
        """Pass on a sample; see `SampleIterator.put`."""
        for reference in tuple(self._iterators):
            iterator = reference()
            if iterator is None:
                # Here alone: other threads only append.
                self._iterators.remove(reference)
            else:
                iterator.put(make, arrived_us)

    def end(self, failure: WheelwireError | None) -> None:
        """As `SampleIterator.end`, of all that there are and will be."""
        self._failure = failure
        # Before the list is read: an iterator that is made meanwhile is in it, or sees this.
        self._is_over = True
        for reference in tuple(self._iterators):
            iterator = reference()
            if iterator is not None:
                iterator.end(failure)
