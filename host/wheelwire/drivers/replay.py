"""The driver of a recording, which gives the measurements of its day again."""

from __future__ import annotations

from functools import partial
from typing import Any

from ..arguments import timeout_s
from ..link.clock import host_clock_us
from ..log.reader import records
from ..log.replay import Comparison, ReplayLink
from ..robot.robot import Robot
from .options import ReplayOptions, takes


class ReplayDriver(Robot):
    """A recording, as a robot. It is opened at its first session.

    It accepts setpoints and compares them with those of the day; it accepts stops; it answers other
    requests if they were answered on that day. At the end of the recording calls raise
    `LinkClosed`, and iterators end.

    Args:
        file: The recording.
        speed: How much faster than on the day time passes; with 0 it passes only in `advance` and
            while a call waits, and one thread may use the driver.

    Attributes:
        speed: As it was given.

    Raises:
        InvalidArgument: One of these is of a wrong type or size.
        RecordingError: The file is no recording, or has no session.
    """

    _link: ReplayLink

    @takes(ReplayOptions)
    def __init__(self, options: ReplayOptions) -> None:
        file, self.speed = options.checked()
        super().__init__(
            partial(ReplayLink, name=str(file), records=partial(records, file), speed=self.speed)
        )
        # Of setpoints: their stamps are today's, whenever the samples were measured.
        if not self._link.in_virtual_time:
            self._now_us = host_clock_us

    @property
    def comparison(self) -> Comparison:
        """This run's setpoints beside the recorded ones, one by one in their order."""
        return self._link.comparison

    def advance(self, seconds: float) -> None:
        """Let time pass.

        Raises:
            InvalidCommand: Time passes by itself.
        """
        self._link.advance(timeout_s("seconds", seconds))

    def noted(self, name: str) -> Any:
        """The newest value that the program of the day passed to `note`, or None."""
        return self._link.noted(name)
