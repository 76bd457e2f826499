"""Records what crosses a link, in its own thread; the link never waits for it.

A record is on the disk after a second. If the disk is full or gone, the recording ends and the
robot drives on. Whatever happens, the MCAP file is undamaged up to the last `sync`.
"""

from __future__ import annotations

import atexit
import fcntl
import logging
import os
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, Protocol

from ..arguments import path as checked_path
from ..errors import InvalidArgument, RecordingError, WheelwireError, afresh
from ..link.threads import abandon_in_child
from ..link.traffic import Kind, Record, Traffic, TrafficReader
from . import ros_messages
from .reader import (
    CLOCK,
    COUNTS,
    ENDED,
    LIBRARY,
    METADATA,
    OFFSET,
    SESSION,
    TOPIC_BY_KIND,
    TOPICS,
    encode_record,
    require_mcap,
)
from .repair import repair_folder
from .ros_messages import Channel
from .summary import Counter
from .views import CHANNELS, Views

PROFILE = "ros2"
REASON_SIZE = 96
"""Room for why a recorder gave up, written at the beginning: a full disk has none at the end."""
_BEGINNING = 4096
"""The metadata are within the first bytes."""
# As rosbag2 writes it for a reliable publisher: without it `ros2 bag play` has to guess.
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


RAW_CHANNELS = tuple(Channel(topic, *ros_messages.BYTES) for topic in TOPICS)


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
            said = {OFFSET: str(unix_minus_monotonic_ns), ENDED: " " * REASON_SIZE, **metadata}
            self._writer.add_metadata(METADATA, said)
            self._schemas: dict[str, int] = {}
            self._channels: dict[str, int] = {}
            for channel in (*RAW_CHANNELS, *channels):
                self.register(channel)
            self.sync()
            _sync_folder(path.parent)
        except BaseException:
            self.discard()
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
        """A record of the link."""
        self._counter.feed(record)
        self.add_message(
            TOPIC_BY_KIND.get(record.kind, SESSION),
            record.host_us * 1000 + self._offset_ns,
            encode_record(record),
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


PERIOD_S = 0.05
"""How often the link's records are fetched."""
CHUNK_S = 0.25
"""How often a chunk is closed: the longest that the interpreter is held for one grows with it."""
SYNC_S = 1.0
"""How much of a recording a power cut destroys, at most."""
SLICE = 16
"""Records between two pauses, in which the link's threads get the interpreter."""
PAUSE_S = 0.0002
QUEUE = 100_000
"""Records that wait while the disk does not answer: 20 s of a link that is driven at 1 kHz."""
MAX_BYTES = 1 << 30
MAX_S = 3600.0
"""Size and duration after which a recording continues in the next file."""
CLOSE_S = 10.0
BEGIN_S = 5.0
"""Records come once the session knows its board, which it asks for up to four times, 1 s each."""
BEGIN_STEP_S = 0.001
CLOCK_STEP_NS = 500_000_000
"""A clock that differs by more was set; below this it is only slewed."""
_LOG = logging.getLogger("wheelwire.log")


class TrafficSource(Protocol):
    """A link that can be listened to."""

    @property
    def traffic(self) -> Traffic:
        """Where a listener is removed."""

    @property
    def has_ended(self) -> bool:
        """Whether the link has ended, so that no record comes any more."""

    def listen_to_traffic(self, reader: TrafficReader) -> None:
        """Give `reader` all records from now on, beginning with the state of the session."""


def wait_until_it_began(link: TrafficSource, reader: TrafficReader) -> None:
    """Wait for the first record: what is asked for next then gets to `reader`, with its answer.

    Raises:
        WheelwireError: The link has ended, or cannot give it any.
    """
    end_s = time.monotonic() + BEGIN_S
    while reader not in link.traffic.readers and not link.has_ended and time.monotonic() < end_s:
        if reader.failure is not None:
            break
        time.sleep(BEGIN_STEP_S)
    if reader.failure is not None:
        raise afresh(reader.failure)


class Attachment(NamedTuple):
    """A file within the recording."""

    name: str
    media_type: str
    data: bytes


class _Inlet:
    """Takes the records from a START up to the first that is missing.

    Behind a gap a session cannot be run again.

    Attributes:
        has_gap: A record is missing.
        has_begun: The START has come.
        lost: Records that are missing or came behind one that is.
    """

    def __init__(self) -> None:
        self.reader = TrafficReader(QUEUE)
        self.has_gap = False
        self.lost = 0
        self.has_begun = False

    def take(self) -> list[Record]:
        records = self.reader.take()
        if not records:
            return []
        if not self.has_begun:
            self.has_begun = True
            self.has_gap = records[0].kind is not Kind.START
        elif self.reader.lost > 0:
            self.has_gap = True
        if not self.has_gap:
            return records
        self.lost += len(records) + self.reader.lost
        self.reader.lost = 0
        return []


class Recorder:
    """Records a link until it ends or `close` is called, as the exit of `with` does.

    Args:
        link: To be recorded.
        path: The file; a folder: a file in it that is named by the time. An existing file is never
            overwritten: the new one gets a number after its name.
        metadata: What the file says of the robot.
        attachments: Returns what to attach; called once, in its own thread. What it raises is the
            error of a recording that is whole but for that.

    Attributes:
        lost: Records that came faster than they could be written.
        error: Why the recording has ended before the link.
        files: All files written, in order; the last may still grow.

    Raises:
        RecordingError: The file cannot be made, or the package `mcap` is not installed.
    """

    def __init__(
        self,
        link: TrafficSource,
        path: str | Path,
        metadata: Mapping[str, str],
        attachments: Callable[[], Iterable[Attachment]] | None = None,
    ) -> None:
        self.lost = 0
        self.error: RecordingError | None = None
        self.files: list[Path] = []
        self._link = link
        self._path = recording_path(path)
        self._metadata = dict(metadata)
        self._offset_ns = _clock_offset_ns()
        self._part = 0
        self._file = self._next_file()
        self._views = Views(self._offset_ns)
        self._successor: _Inlet | None = None
        """The next inlet: for the next file, or after a loss."""
        self._lost_before = 0
        """Records that earlier inlets lost."""
        self._attached: list[Attachment] = []
        self._unattached: Exception | None = None
        self._closing = threading.Event()
        self._pid = os.getpid()
        self._synced_s = self._chunk_s = time.monotonic()
        self._inlet = self._listen()
        try:
            wait_until_it_began(link, self._inlet.reader)
        except BaseException:  # of a file that would stay empty nothing is left
            link.traffic.remove(self._inlet.reader)
            self._file.discard()
            raise
        self._thread = threading.Thread(target=self._run, name="wheelwire recorder", daemon=True)
        self._thread.start()
        threading.Thread(target=repair_folder, args=(self._path.parent,), daemon=True).start()
        if attachments is not None:
            threading.Thread(target=self._fetch, args=(attachments,), daemon=True).start()
        atexit.register(self.close)

    @property
    def file(self) -> Path:
        """The file that is being written, or was last."""
        return self._file.path

    def close(self) -> None:
        """Write what is left and the file's end. Safe to call more than once."""
        self._closing.set()
        if os.getpid() == self._pid and threading.current_thread() is not self._thread:
            self._thread.join(CLOSE_S)
        atexit.unregister(self.close)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _next_file(self) -> RecordingFile:
        self._part += 1
        self._began_s = time.monotonic()
        said = self._metadata | {"part": str(self._part)}
        if self._part > 1:
            said["previous"] = self._file.path.name
        while True:
            path = free_path(self._path)
            try:
                file = RecordingFile(path, self._offset_ns, said, CHANNELS)
            except FileExistsError:
                continue  # another recorder was faster
            except OSError as error:
                raise RecordingError(
                    f"cannot record to {path}: {error.strerror}; choose another folder"
                ) from error
            abandon_in_child(file)
            self.files.append(path)
            return file

    def _fetch(self, attachments: Callable[[], Iterable[Attachment]]) -> None:
        try:
            self._attached += attachments()
        except Exception as error:
            if not (isinstance(error, WheelwireError) and self._link.has_ended):
                self._unattached = error

    # --- the thread ------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._closing.wait(PERIOD_S) and not self._link.has_ended:
                self._write(self._taken())
                self._check_failure()
                self._keep_time()
            self._write(self._taken())
            self._attach()
            self._check_begun()
            self._file.close()
            if self._unattached is not None:
                why = f"{self.file} is whole, but not all is attached: {self._unattached!r}"
                self.error = RecordingError(why)
        except Exception as error:
            self._give_up(error)
        finally:
            for inlet in (self._inlet, self._successor):
                if inlet is not None:
                    self._link.traffic.remove(inlet.reader)

    def _check_failure(self) -> None:
        """Raise why the link gives it nothing."""
        for inlet in (self._inlet, self._successor):
            if inlet is not None and inlet.reader.failure is not None and not self._link.has_ended:
                raise RecordingError(str(inlet.reader.failure))

    def _check_begun(self) -> None:
        """Raise if nothing was recorded at all."""
        self._check_failure()
        if not self._inlet.has_begun and self._part == 1:
            raise RecordingError("the link has given nothing to record: run it again")

    def _give_up(self, error: Exception) -> None:
        known = isinstance(error, WheelwireError)
        reason = getattr(error, "strerror", None) or (error if known else repr(error))
        if not known and not isinstance(error, OSError):
            _LOG.error("the recorder has failed", exc_info=error)
        self.error = RecordingError(f"the recording {self.file} has ended: {reason}")
        _LOG.error("%s; the robot still drives", self.error)
        with suppress(OSError):  # a full disk may report its error again
            self._file.give_up(str(reason))

    def _taken(self) -> list[Record]:
        """The records for this file. Begins the next file, or restarts after a loss."""
        records = self._inlet.take()
        if self._inlet.has_gap:
            self.lost = self._lost_before + self._inlet.lost
            if self._successor is None:
                self._successor = self._listen()
        fresh = self._successor.take() if self._successor is not None else []
        if self._successor is not None and self._successor.has_gap:
            self._link.traffic.remove(self._successor.reader)
            self._successor = self._listen()
        if not fresh or self._successor is None:
            return records
        self._write([record for record in records if record.number < fresh[0].number])
        self._link.traffic.remove(self._inlet.reader)
        self._inlet, self._successor = self._successor, None
        self._lost_before = self.lost
        if self._is_full:
            self._file.close()
            self._file = self._next_file()
        return fresh

    def _listen(self) -> _Inlet:
        inlet = _Inlet()
        self._link.listen_to_traffic(inlet.reader)
        return inlet

    def _write(self, records: list[Record]) -> None:
        file, views = self._file, self._views
        for begin in range(0, len(records), SLICE):
            for record in records[begin : begin + SLICE]:
                file.add(record)
                for channel, time_ns, data in views.feed(record):
                    file.register(channel)
                    file.add_message(channel.topic, time_ns, data)
            time.sleep(PAUSE_S)

    def _keep_time(self) -> None:
        now_s = time.monotonic()
        offset_ns = _clock_offset_ns()
        if abs(offset_ns - self._offset_ns) >= CLOCK_STEP_NS:
            self._offset_ns = self._views.offset_ns = offset_ns
            self._file.set_clock(offset_ns)
        if now_s - self._synced_s >= SYNC_S:
            self._attach()
            self._file.sync()
            self._synced_s = self._chunk_s = now_s
            if self._is_full and self._successor is None:
                self._successor = self._listen()
        elif now_s - self._chunk_s >= CHUNK_S:
            self._file.flush()
            self._chunk_s = now_s

    @property
    def _is_full(self) -> bool:
        age_s = time.monotonic() - self._began_s
        return self._file.size >= MAX_BYTES or age_s >= MAX_S

    def _attach(self) -> None:
        while self._attached:
            self._file.attach(*self._attached.pop(0), time.time_ns())


def _clock_offset_ns() -> int:
    return time.time_ns() - time.monotonic_ns()


def recording_path(path: str | Path) -> Path:
    """The file that is meant.

    Raises:
        InvalidArgument: The name is neither a folder's nor that of a recording.
        RecordingError: None can be made there.
    """
    require_mcap()
    found = checked_path("path", path)
    if found.is_dir():
        found /= f"wheelwire-{datetime.now().astimezone():%Y%m%d-%H%M%S}.mcap"
    elif found.suffix.lower() != ".mcap":
        raise InvalidArgument(f"{path}: a recording's name ends in .mcap, or name a folder")
    if not found.parent.is_dir():
        raise RecordingError(
            f"cannot record to {found}: there is no folder {found.parent}; make it first"
        )
    if not os.access(found.parent, os.W_OK):
        raise RecordingError(
            f"cannot record to {found}: its folder cannot be written to; choose another one"
        )
    return found
