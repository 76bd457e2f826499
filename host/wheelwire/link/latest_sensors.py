"""Passes sensors' samples and events on to those who iterate over them, and logs the events."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from typing import Any
from weakref import ref

from ..errors import WheelwireError
from ..sensors import SensorEvent
from .sample_iterator import SampleIterator
from .sensor_stream import Sensed

_log = logging.getLogger("wheelwire.sensors")


class EventMeasurement:
    """An event, which is its own sample."""

    __slots__ = ("_event", "arrived_us")

    def __init__(self, event: SensorEvent, arrived_us: int) -> None:
        self._event = event
        self.arrived_us = arrived_us

    def sample(self) -> SensorEvent:
        """The event."""
        return self._event


class SensorQueues:
    """The iterators over the sensors of one driver.

    One thread at a time passes on; any thread may iterate.
    """

    def __init__(self) -> None:
        self._iterators: list[tuple[str, ref[SampleIterator[Any]]]] = []
        """Copied before iterating: other threads add to it."""
        self._failure: WheelwireError | None = None
        self._is_over = False

    @property
    def is_iterated(self) -> bool:
        """Whether anyone wants a sample without delay."""
        return bool(self._iterators)

    def take(self, port: str, sensed: deque[Sensed]) -> None:
        """Pass on what has come, and log the events of the robot at this port."""
        while sensed:
            group, what, arrived_us = sensed.popleft()
            if isinstance(what, SensorEvent):
                level = logging.WARNING if what.is_warning else logging.INFO
                _log.log(level, "%s: %s", port, what.sentence)
                self._put(group, EventMeasurement(what, arrived_us))
            elif self._iterators:
                self._put(group, what)

    def _put(self, group: str, measurement: Any) -> None:
        for known in tuple(self._iterators):
            iterator = known[1]()
            if iterator is None:
                # Here alone: other threads only append.
                self._iterators.remove(known)
            elif known[0] == group:
                iterator.put(measurement)

    def iterate(
        self, group: str, wait: Callable[[Callable[[], bool]], None], queue_us: int
    ) -> SampleIterator[Any]:
        """All samples or events of this group from now on."""
        iterator: SampleIterator[Any] = SampleIterator(wait, queue_us)
        # Weakly: one that was abandoned in the middle of a loop is no longer filled.
        self._iterators.append((group, ref(iterator)))
        if self._is_over:  # possibly before it was listed
            iterator.end(self._failure)
        return iterator

    def end(self, failure: WheelwireError | None) -> None:
        """No sample will come any more: because the driver is closed, or for `failure`."""
        self._failure = failure
        self._is_over = True
        for _, reference in tuple(self._iterators):
            iterator = reference()
            if iterator is not None:
                iterator.end(failure)
