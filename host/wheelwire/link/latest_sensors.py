"""Passes sensors' samples and events on to those who iterate over them, and logs the events."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from typing import Any

from ..errors import WheelwireError
from ..sensors import SensorEvent
from .sample_iterator import SampleIterator, SampleIterators
from .sensor_stream import EVENTS, IMU, INPUTS, POWER, RANGE, Sensed

_log = logging.getLogger("wheelwire.sensors")


class SensorQueues:
    """The iterators over the sensors of one driver.

    One thread at a time passes on; any thread may iterate.
    """

    def __init__(self) -> None:
        self._iterators: dict[str, SampleIterators[Any]] = {
            group: SampleIterators() for group in (IMU, POWER, INPUTS, RANGE, EVENTS)
        }

    @property
    def is_iterated(self) -> bool:
        """Whether anyone wants a sample without delay."""
        return any(iterators.is_iterated for iterators in self._iterators.values())

    def take(self, port: str, sensed: deque[Sensed]) -> None:
        """Pass on what has come, and log the events of the robot at this port."""
        while sensed:
            group, what, arrived_us = sensed.popleft()
            if isinstance(what, SensorEvent):
                self._pass_on_event(port, what, arrived_us)
            else:
                self._iterators[group].put(what.sample, arrived_us)

    def _pass_on_event(self, port: str, event: SensorEvent, arrived_us: int) -> None:
        level = logging.WARNING if event.is_warning else logging.INFO
        _log.log(level, "%s: %s", port, event.sentence)
        self._iterators[EVENTS].put(lambda: event, arrived_us)

    def iterate(
        self, group: str, wait: Callable[[Callable[[], bool]], None], queue_us: int
    ) -> SampleIterator[Any]:
        """All samples or events of this group from now on."""
        return self._iterators[group].iterate(wait, queue_us)

    def end(self, failure: WheelwireError | None) -> None:
        """No sample will come any more: because the driver is closed, or for `failure`."""
        for iterators in self._iterators.values():
            iterators.end(failure)
