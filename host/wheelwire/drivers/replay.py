"""The driver of a recording, which gives the measurements of its day again."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ..arguments import is_number, path, timeout_s
from ..errors import InvalidArgument, shown
from ..link.clock import host_clock_us
from ..log.reader import check_cut_off, records
from ..log.replay import Comparison, ReplayLink
from ..robot.robot import Robot
from .options import takes

MAX_SPEED = 1000


@dataclass(frozen=True, kw_only=True)
class ReplayOptions:
    """The options of `ReplayDriver`."""

    file: str | Path
    speed: float = 1.0

    def checked(self) -> tuple[Path, float]:
        """File and speed, checked."""
        if not (is_number(self.speed) and 0 <= self.speed <= MAX_SPEED):
            raise InvalidArgument(
                f"speed = {shown(self.speed)}: give a number from 0 (step by step) to {MAX_SPEED}"
            )
        return path("file", self.file), float(self.speed)


class ReplayDriver(Robot):
    """A recording, as a robot. It is opened at its first session.

    It accepts setpoints and compares them with the recorded ones. It accepts stops. It answers
    other requests if the recording has an answer. At the end of the recording calls raise
    `LinkClosed`, and iterators end.

    Args:
        file: The recording.
        speed: How much faster time passes than in the recording. With 0 it passes only in `advance`
            and while a call waits, and only one thread may use the driver.

    Attributes:
        speed: As it was given.

    Raises:
        InvalidArgument: One of these is of a wrong type or size.
        RecordingError: The file is not a recording, or has no session.
    """

    _link: ReplayLink

    @takes(ReplayOptions)
    def __init__(self, options: ReplayOptions) -> None:
        file, self.speed = options.checked()
        super().__init__(
            partial(
                ReplayLink,
                name=str(file),
                records=partial(records, file),
                speed=self.speed,
                check_cut_off=partial(check_cut_off, file),
            )
        )
        # Setpoints are stamped now, whenever the samples were measured.
        if not self._link.in_virtual_time:
            self._now_us = host_clock_us

    @property
    def comparison(self) -> Comparison:
        """This run's setpoints next to the recorded ones, one by one in order."""
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
