"""Writes an MCAP file, which is undamaged up to the last `sync`, whatever happens."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from ..link.traffic import Record
from . import raw
from .reader import CLOCK, COUNTS, ENDED, METADATA, OFFSET, require_mcap
from .summary import Counter

LIBRARY = "wheelwire"
"""The entry in the file's header that marks our files."""
PROFILE = "ros2"
REASON_SIZE = 96
"""Room for why a recorder gave up, written at the beginning: a full disk has none at the end."""
_BEGINNING = 4096
"""The metadata are within the first bytes."""
# What rosbag2 itself writes of a reliable publisher: without it `ros2 bag play` has to guess.
_QOS = """- history: 1
  depth: 10
  reliability: 1
  durability: 2
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""


class Channel(NamedTuple):
    """A topic and its messages."""

    topic: str
    schema: str
    """The name of a ROS 2 message."""
    definition: str
    """The message in ROS 2's own language, the messages that it contains included."""


RAW_DEFINITION = """MultiArrayLayout layout
uint8[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""
RAW_CHANNELS = tuple(
    Channel(topic, "std_msgs/msg/UInt8MultiArray", RAW_DEFINITION) for topic in raw.TOPICS
)


class _Output:
    """What `mcap` writes to. Keeps all until a flush, and after a failure writes nothing more."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._waiting: list[bytes] = []
        self._count = 0

    def write(self, data: bytes) -> int:
        self._waiting.append(bytes(data))
        self._count += len(data)
        return len(data)

    def tell(self) -> int:
        return self._count

    def flush(self) -> None:
        rest = memoryview(b"".join(self._waiting))
        self._waiting.clear()
        while rest:
            rest = rest[os.write(self._descriptor, rest) :]


class RecordingFile:
    """A file that is being written. Others see by its lock that it is.

    Args:
        path: Must not exist.
        unix_minus_monotonic_ns: What to add to the host's clock for the time of day.
        metadata: What else to write at its beginning.
        channels: Channels of the messages for viewers.

    Attributes:
        path: Where it is.
        size: Bytes written.

    Raises:
        RecordingError: The package `mcap` is not installed.
        FileExistsError: There is one.
        OSError: It cannot be written.
    """

    def __init__(
        self,
        path: Path,
        unix_minus_monotonic_ns: int,
        metadata: Mapping[str, str],
        channels: tuple[Channel, ...] = (),
    ) -> None:
        require_mcap()
        from mcap.writer import CompressionType, Writer

        self.path = path
        self._offset_ns = unix_minus_monotonic_ns
        self._descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_CLOEXEC, 0o644)
        self._output = _Output(self._descriptor)
        self._counter = Counter()
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._writer = Writer(self._output, compression=CompressionType.NONE)
            self._writer.start(PROFILE, LIBRARY)
            said = {
                OFFSET: str(unix_minus_monotonic_ns),
                ENDED: " " * REASON_SIZE,
                **metadata,
            }
            self._writer.add_metadata(METADATA, said)
            self._schemas: dict[str, int] = {}
            self._channels: dict[str, int] = {}
            for channel in (*RAW_CHANNELS, *channels):
                self.register(channel)
            self.sync()
            _sync_folder(path.parent)
        except BaseException:
            self.abandon()
            raise

    def register(self, channel: Channel) -> None:
        """Add a channel, unless there is one of its topic."""
        topic, schema, definition = channel
        if topic in self._channels:
            return
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(
                schema, "ros2msg", definition.encode()
            )
        self._channels[topic] = self._writer.register_channel(
            topic, "cdr", self._schemas[schema], {"offered_qos_profiles": _QOS}
        )

    @property
    def size(self) -> int:
        """Bytes written."""
        return self._output.tell()

    def add(self, record: Record) -> None:
        """A record of the tap."""
        self._counter.feed(record)
        self.add_message(
            raw.TOPIC_BY_KIND.get(record.kind, raw.SESSION),
            record.host_us * 1000 + self._offset_ns,
            raw.encode(record),
            record.number & 0xFFFFFFFF,
        )

    def add_message(self, topic: str, time_ns: int, data: bytes, sequence: int = 0) -> None:
        """A message for viewers."""
        self._writer.add_message(self._channels[topic], time_ns, data, time_ns, sequence)

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        """A file within the file."""
        self._writer.flush()  # mcap puts it between two chunks
        self._writer.add_attachment(time_ns, time_ns, name, media_type, data)

    def flush(self) -> None:
        """Write all that was added to the file, in case this process is killed."""
        self._writer.flush()

    def sync(self) -> None:
        """Write all that was added to the disk, in case the power fails."""
        self._writer.flush()
        os.fdatasync(self._descriptor)

    def close(self) -> None:
        """Write what was counted and the index, and close the file."""
        try:
            self._writer.flush()  # mcap puts it between two chunks
            counted = {name: str(number) for name, number in vars(self._counter.counts).items()}
            self._writer.add_metadata(COUNTS, counted)
            self.sync()  # first: a file that has an end is whole
            self._writer.finish()
            self._output.flush()
            os.fdatasync(self._descriptor)
        finally:
            self.abandon()

    def discard(self) -> None:
        """Close the file and remove it: nothing is in it."""
        self.abandon()
        self.path.unlink(missing_ok=True)

    def set_clock(self, unix_minus_monotonic_ns: int) -> None:
        """The computer's clock was set: what is added from now on has the new time of day."""
        self._offset_ns = unix_minus_monotonic_ns
        self._writer.flush()  # mcap puts it between two chunks
        self._writer.add_metadata(CLOCK, {OFFSET: str(unix_minus_monotonic_ns)})

    def give_up(self, reason: str) -> None:
        """Note in the file why nothing more is written, where there is room for it; close it.

        Raises:
            OSError: It cannot be written to at all.
        """
        try:
            text = reason.encode()[:REASON_SIZE].decode("utf-8", "ignore").encode()
            begin = os.pread(self._descriptor, _BEGINNING, 0)
            blank = ENDED.encode() + REASON_SIZE.to_bytes(4, "little")
            at = begin.find(blank)
            if at >= 0:
                os.pwrite(self._descriptor, text.ljust(REASON_SIZE), at + len(blank))
            os.fdatasync(self._descriptor)
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file as it is, without what cannot be written any more.

        A second call does nothing.
        """
        # Its number is free from now on, and soon another file's: a fork's child, say, must not
        # close that.
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


def _sync_folder(folder: Path) -> None:
    """Make the file's name survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def free_path(path: Path) -> Path:
    """`path`, or with a number behind its name the first that no file has."""
    number = 1
    found = path
    while found.exists():
        number += 1
        found = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return found
