"""What a recording holds, in a few numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import datetime, timezone
from pathlib import Path

from ..link.traffic import Record
from . import reader
from .rerun import FrameReader


@dataclass
class Counts:
    """What is counted of a file's records, as it is written or read.

    Attributes:
        records: Records of the link.
        first_us: The host's clock at the first.
        last_us: The same at the last.
        frames_received: Good frames from the robot.
        frames_sent: Frames that the port took.
        frames_lost: On the way from the robot, by their sequence numbers.
    """

    records: int = 0
    first_us: int = 0
    last_us: int = 0
    frames_received: int = 0
    frames_sent: int = 0
    frames_lost: int = 0

    @classmethod
    def of(cls, said: Mapping[str, str]) -> Counts:
        """What a file says.

        Raises:
            KeyError, ValueError: It is of another release, or damaged.
        """
        return cls(*(int(said[field.name]) for field in fields(cls)))


class Counter:
    """Counts records."""

    def __init__(self) -> None:
        self._counts = Counts()
        self._reader = FrameReader()

    @property
    def counts(self) -> Counts:
        """The counts of the records fed so far."""
        self._counts.frames_lost = self._reader.lost  # here: to ask for each record costs more
        return self._counts

    def feed(self, record: Record) -> None:
        """Count one record."""
        counts = self._counts
        counts.first_us = counts.first_us if counts.records else record.host_us
        counts.last_us = max(counts.last_us, record.host_us)
        counts.records += 1
        for frame in self._reader.feed(record):
            if frame.is_sent:
                counts.frames_sent += 1
            else:
                counts.frames_received += 1


@dataclass(frozen=True)
class Summary:
    """A recording at a glance.

    Attributes:
        duration_s: From its first record to its last.
        frames_received: Good frames from the robot.
        frames_sent: Frames that the port took.
        frames_lost: On the way from the robot, by their sequence numbers.
        board_id: The robot's board id, as 12 hex digits.
        complete: Whether it has its end; a crash leaves a file without one.
        ended_by: Why the recorder gave up before its link ended, such as a full disk; else empty.
        began: The time of day, in UTC.
        driver: The name of the program's driver.
        version: Version of the Wheelwire that recorded it.
        size_bytes: Size of the file.
    """

    duration_s: float
    frames_received: int
    frames_sent: int
    frames_lost: int
    board_id: str
    complete: bool
    ended_by: str
    began: str
    driver: str
    version: str
    size_bytes: int


def summary(path: str | Path) -> Summary:
    """Summarise a recording, by what its end says; one without an end is read in full.

    Raises:
        RecordingError: The file cannot be read, is not a recording, or is from another release; or
            it lacks what crossed the link.
    """
    said = reader.metadata(path)
    reader.check_release(path)
    counted, complete = _said_at_end(path), True
    if counted is None:
        counted, complete = _counted(path), reader.is_complete(path)
    return Summary(
        duration_s=(counted.last_us - counted.first_us) / 1e6,
        frames_received=counted.frames_received,
        frames_sent=counted.frames_sent,
        frames_lost=counted.frames_lost,
        board_id=said.get("board_id", ""),
        complete=complete,
        ended_by=said.get(reader.ENDED, ""),
        began=time_of_day(counted.first_us, path),
        driver=said.get("driver", ""),
        version=said.get("version", ""),
        size_bytes=Path(path).stat().st_size,
    )


def _said_at_end(path: str | Path) -> Counts | None:
    try:
        return None if (said := reader.counts(path)) is None else Counts.of(said)
    except (KeyError, ValueError):
        return None


def _counted(path: str | Path) -> Counts:
    counter = Counter()
    with reader.damage_of(path):
        for record in reader.session_records(path):
            counter.feed(record)
    return counter.counts


def time_of_day(host_us: int, path: str | Path) -> str:
    """A time of the host's clock, in UTC, by what the recording says."""
    moment = datetime.fromtimestamp((host_us + reader.offset_us(path)) / 1e6, timezone.utc)
    return moment.isoformat(timespec="seconds")
