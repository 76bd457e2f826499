"""What a recording holds, in a few numbers."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

from ..errors import RecordingError
from ..link.tap import Kind
from .frames import FrameReader
from .reader import ENDED, is_complete, metadata, offset_us, session_records
from .rerun import Rerun


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
    """Read all of a recording.

    Raises:
        RecordingError: The file cannot be read, is no recording, or of another release; or what
            crossed the link is not in it.
    """
    said = metadata(path)
    again, reader = Rerun(), FrameReader()
    first_us = received = sent = lost = 0

    def count() -> tuple[int, int]:
        if again.session is None:
            return received, lost
        counted = again.session.statistics(again.host_us)
        return received + counted.frames_received, lost + counted.frames_lost

    try:
        for record in session_records(path):
            if record.kind is Kind.START:  # anew, where records are missing
                received, lost = count()
                first_us = first_us or record.host_us
            again.feed(record)
            if record.kind is Kind.SENT:
                sent += sum(1 for _ in reader.feed(record))
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error
    received, lost = count()
    return Summary(
        duration_s=(again.host_us - first_us) / 1e6,
        frames_received=received,
        frames_sent=sent,
        frames_lost=lost,
        board_id=said.get("board_id", ""),
        complete=is_complete(path),
        ended_by=said.get(ENDED, ""),
        began=time_of_day(first_us, path),
        driver=said.get("driver", ""),
        version=said.get("version", ""),
        size_bytes=Path(path).stat().st_size,
    )


def time_of_day(host_us: int, path: str | Path) -> str:
    """A time of the host's clock, in UTC, by what the recording says."""
    moment = datetime.fromtimestamp((host_us + offset_us(path)) / 1e6, timezone.utc)
    return moment.isoformat(timespec="seconds")
