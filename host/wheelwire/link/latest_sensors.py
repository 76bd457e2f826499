"""Passes sensors' samples and events on to those who iterate over them, and logs the events."""

from __future__ import annotations

import logging
from collections import deque
from typing import Any

from ..errors import WheelwireError
from ..sensors import SensorEvent
from .sample_iterator import SampleIterators
from .sensor_stream import EVENTS, IMU, INPUTS, POWER, RANGE, Sensed

_log = logging.getLogger("wheelwire.sensors")


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
        return any(iterators.is_iterated for iterators in self.iterators.values())

    def take(self, port: str, sensed: deque[Sensed]) -> None:
        """Pass on what has come, and log the events of the robot at this port."""
        while sensed:
            group, what, arrived_us = sensed.popleft()
            if isinstance(what, SensorEvent):
                self._pass_on_event(port, what, arrived_us)
            else:
                self.iterators[group].put(what.sample, arrived_us)

    def _pass_on_event(self, port: str, event: SensorEvent, arrived_us: int) -> None:
        level = logging.WARNING if event.is_warning else logging.INFO
        _log.log(level, "%s: %s", port, event.sentence)
        self.iterators[EVENTS].put(lambda: event, arrived_us)

    def end(self, failure: WheelwireError | None) -> None:
        """No sample will come any more: because the driver is closed, or for `failure`."""
        for iterators in self.iterators.values():
            iterators.end(failure)
