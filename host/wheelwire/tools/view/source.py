"""Looks at a driver, and fills the model. Never waits for the robot."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue

from ...errors import InvalidCommand, LinkClosed, RecordingError, RequestTimeout, WheelwireError
from ...link.clock import host_clock_us
from ...link.holds import Holding
from ...log.reader import damage_of, session_records, was_cut
from ...log.why.device import standing_stops
from ...log.why.diagnosis import Diagnosis, Stop
from ...robot.robot import Robot
from .model import Look, Model, Status

LOOKS_PER_STATUS = 10
"""Looks for each status, which costs more: quantiles of the link are of 1024 round trips."""
SILENT_S = 2.0
"""A robot without a sample for this long counts as silent; the slowest stream has one a second."""


class Source:
    """Looks at one driver.

    Args:
        robot: To be looked at; is closed by its owner.
        model: Takes what is found.
        recording: The file, if the robot is one.
    """

    def __init__(self, robot: Robot, model: Model, recording: Path | None = None) -> None:
        self._robot = robot
        self._model = model
        self._stops: SimpleQueue[Stop] = SimpleQueue()
        self._recorded = None if recording is None else _RecordedStops(recording)
        self._looks = 0
        if robot.has_device:
            with suppress(InvalidCommand):  # in virtual time, or a recording
                robot.watch_stops(self._stops.put)

    def look(self) -> None:
        """Look once.

        Raises:
            LinkClosed: Nothing will come any more.
            RecordingError: The recording is damaged.
        """
        robot, model = self._robot, self._model
        latest, asked, trouble = robot.latest, None, ""
        ended: WheelwireError | None = None
        try:
            trouble = self._trouble(None if latest is None else latest.age_s)
        except (LinkClosed, RecordingError) as error:
            ended = error  # once what came before it was taken
        if robot.has_device:
            with suppress(WheelwireError):
                asked = robot.asked
        now_s = time.monotonic() if latest is None else latest.sample.stamp + latest.age_s
        if latest is not None or self._recorded is None:  # a recording has its own time
            sample = None if latest is None else latest.sample
            model.take(Look(now_s, sample, asked, trouble))
        if self._recorded is not None:
            self._play(self._recorded, ended=ended is not None)
        with suppress(Empty):
            while True:
                model.take_stop(self._stops.get_nowait())
        if self._looks % LOOKS_PER_STATUS == 0:
            model.status = self._status()
        self._looks += 1
        if ended is not None:
            raise ended

    def _play(self, recorded: _RecordedStops, *, ended: bool) -> None:
        with suppress(WheelwireError):
            self._robot.read(0)  # its time passes while somebody reads it
        now_us = round(self._model.now_s * 1e6)
        for stop in recorded.rest() if ended else recorded.until(now_us):
            self._model.take_stop(stop)

    def _trouble(self, age_s: float | None) -> str:
        robot = self._robot
        if not robot.is_open:
            try:
                robot.read(0)  # its error says why
            except (LinkClosed, RecordingError):
                raise
            except RequestTimeout:
                return ""  # it is back
            except WheelwireError as error:
                return str(error)
        is_silent = age_s is not None and age_s > SILENT_S
        return "the robot sends nothing: check its power and the stream rate" if is_silent else ""

    def _status(self) -> Status:
        robot, sample = self._robot, self._model.sample
        if not robot.has_device:
            return Status(robot.statistics)
        try:
            device, warnings = robot.info.device, robot.warnings
        except WheelwireError:  # out of reach
            return Status(robot.statistics, self._model.status.standing)
        held_by, last = robot.held_by, robot.last_stop
        holding = None if held_by is None or last is None else Holding(held_by, last)
        standing = (
            ()
            if sample is None
            else standing_stops(
                device, sample.state, sample.faults, host_clock_us(), holding=holding
            )
        )
        return Status(robot.statistics, standing, warnings, held_by)


class _RecordedStops:
    """The stops of a recording, as its time passes."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._diagnosis = Diagnosis()
        self._records = session_records(file)
        self._next = next(self._records, None)

    def until(self, now_us: int) -> list[Stop]:
        """The stops until then that earlier calls did not return.

        Raises:
            RecordingError: The file is damaged.
        """
        stops: list[Stop] = []
        with damage_of(self._file):
            while self._next is not None and self._next.host_us <= now_us:
                stops += self._diagnosis.feed(self._next)
                self._next = next(self._records, None)
        return stops

    def rest(self) -> list[Stop]:
        """The remaining stops up to the end; raises as `until` does."""
        stops = self.until(sys.maxsize)
        return stops + self._diagnosis.end(complete=not was_cut(self._file))
