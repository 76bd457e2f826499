"""Recordings of simulated robots, and what other programs make of their files."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from pathlib import Path

from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from wheelwire import open_driver
from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.link.traffic import Record, TrafficReader
from wheelwire.log.reader import TOPICS
from wheelwire.log.recorder import RecordingFile

OFFSET_NS = 1_700_000_000_000_000_000
SAID = {"driver": "mock", "board_id": "0a1b2c3d4e5f"}


def traffic_of(play: Callable[[VirtualMockDriver], object]) -> list[Record]:
    """What crosses the link of a robot in virtual time."""
    reader = TrafficReader(limit=1_000_000)
    with open_driver("mock", realtime=False) as robot:
        assert isinstance(robot, VirtualMockDriver)
        robot.advance(0.05)  # until the session knows the board; before that a tap waits
        robot._link.listen_to_traffic(reader)
        play(robot)
    return reader.take()


def write(
    path: Path, records: Iterable[Record], *, ends: bool = True, said: Mapping[str, str] = SAID
) -> Path:
    """A recording that was closed, or cut off."""
    file = RecordingFile(path, OFFSET_NS, dict(said))
    for record in records:
        file.add(record)
    if ends:
        file.close()
    else:
        file.sync()
        file.abandon()
    return path


def rewritten(
    source: Path,
    path: Path,
    topics: Collection[str] = TOPICS,
    *,
    chunked: bool = True,
    compression: CompressionType = CompressionType.NONE,
) -> Path:
    """As another program writes it again."""
    with source.open("rb") as old, path.open("wb") as new:
        writer = Writer(new, compression=compression, use_chunking=chunked)
        writer.start("ros2", "another program")
        wanted: set[int] = set()
        for record in StreamReader(old).records:
            kind = type(record).__name__
            if kind == "Metadata":
                writer.add_metadata(record.name, record.metadata)
            elif kind == "Schema":
                writer.register_schema(record.name, record.encoding, record.data)
            elif kind == "Channel":
                writer.register_channel(record.topic, "cdr", record.schema_id, record.metadata)
                wanted |= {record.id} if record.topic in topics else set()
            elif kind == "Message" and record.channel_id in wanted:
                writer.add_message(record.channel_id, record.log_time, record.data, 1)
        writer.finish()
    return path
