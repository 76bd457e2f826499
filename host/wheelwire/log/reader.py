"""Reads recordings. After a crash it reads an incomplete file up to its last chunk.

The package `mcap` reads its parts; its own readers refuse a file that does not end.
"""

from __future__ import annotations

import fcntl
import os
import stat
import struct
import zlib
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, cast

from wheelwire_protocol.codec import schema_hash

from ..errors import RecordingError
from ..link.traffic import Kind, Record
from .ros_messages import CDR_HEADER

RECEIVED = "/wheelwire/received"
SENT = "/wheelwire/sent"
SESSION = "/wheelwire/session"
TOPICS = (RECEIVED, SENT, SESSION)

TOPIC_BY_KIND = {Kind.RECEIVED: RECEIVED, Kind.RECEIVED_EACH: RECEIVED, Kind.SENT: SENT}
"""The channels of these records; all others are in `SESSION`."""
# No dimension, no offset, the number of bytes; then of the bytes: number, kind, host_us.
_LAYOUT = struct.Struct("<4s3IQBq")
_RECORD_SIZE = struct.calcsize("<QBq")


def encode_record(record: Record) -> bytes:
    """The message of a record."""
    size = _RECORD_SIZE + len(record.data)
    head = _LAYOUT.pack(CDR_HEADER, 0, 0, size, record.number, record.kind, record.host_us)
    return head + record.data


def decode_record(message: bytes) -> Record:
    """The record of a message.

    Raises:
        ValueError: The message is of another release.
    """
    try:
        header, dimensions, offset, size, number, kind, host_us = _LAYOUT.unpack_from(message)
    except struct.error as error:
        raise ValueError(f"a message of {len(message)} bytes holds no record") from error
    data = message[_LAYOUT.size :]
    if (header, dimensions, offset, size) != (CDR_HEADER, 0, 0, _RECORD_SIZE + len(data)):
        raise ValueError("the recording is of another release: a message holds no record")
    return Record(number, Kind(kind), host_us, data)


MAGIC = b"\x89MCAP0\r\n"
LIBRARY = "wheelwire"
"""The entry in the file's header that marks our files."""
METADATA = "wheelwire"
"""The name of the metadata record that says what was recorded."""
CLOCK = "wheelwire_clock"
"""The name of one that says that the computer's clock was set, and its new `OFFSET`."""
OFFSET = "unix_minus_monotonic_ns"
"""The entry that says what to add to the host's clock for the time of day."""
ENDED = "ended_by"
"""The entry of `METADATA` that says why a recorder gave up; blank until then."""
COUNTS = "wheelwire_counts"
"""The name of the one at the end that says what was counted: the fields of `summary.Counts`."""
REPAIRED = "wheelwire_repaired"
"""The name of the metadata that a repair adds to a recording that was not closed."""
CUT_OFF = (
    "it was cut off, or damaged, as it began: nothing that the robot sent can be read; record again"
)
_MADE = "name a file that `wheelwire log record` has made"

BUFFER = 8192
"""Python 3.14 reads 128 KiB for the few bytes that a seek leads to."""

HEAD = struct.Struct("<BQ")
"""How a part begins: its opcode, and the length of its content."""
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = range(1, 8)
ATTACHMENT, STATISTICS, METADATA_RECORD, METADATA_INDEX, DATA_END = 9, 11, 12, 13, 15
"""Opcodes of MCAP's specification. The last is the highest."""
_READ = {HEADER: "Header", CHANNEL: "Channel", METADATA_RECORD: "Metadata"}
"""Parts whose form is checked, by the names of what reads them."""
RECEIVED_KINDS = frozenset((Kind.RECEIVED, Kind.RECEIVED_EACH))
_MESSAGE = struct.Struct("<HIQQ")
"""The head of a message: channel, sequence, and two times."""
_DATA_END = HEAD.pack(DATA_END, 4)
_FOOTER = struct.Struct("<BQQQI8s")
"""The end of a file: opcode, length, where the index begins, 0, the index's checksum, magic."""


@dataclass(frozen=True)
class Part:
    """A record of the file's outermost level.

    Attributes:
        offset: Where it begins.
        opcode: What it is, by MCAP's specification.
        content: Without opcode and length.
    """

    offset: int
    opcode: int
    content: bytes

    @property
    def end(self) -> int:
        """Where the next one begins."""
        return self.offset + HEAD.size + len(self.content)


def require_mcap() -> None:
    """Raise `RecordingError` if the package is not installed."""
    try:
        import mcap.records  # noqa: F401 - here, for most programs record nothing
    except ImportError as error:
        raise RecordingError(
            "recordings need the package mcap: pip install 'wheelwire[record]'"
        ) from error


def parts(file: BinaryIO) -> Iterator[Part]:
    """The whole parts of the data section, in order, up to the first that is damaged or cut."""
    size = file.seek(0, 2)
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        return
    offset = len(MAGIC)
    while True:
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            return
        opcode, length = HEAD.unpack(head)
        # A page that was never written reads as zeros.
        if not HEADER <= opcode <= DATA_END or offset + HEAD.size + length > size:
            return
        part = Part(offset, opcode, file.read(length))
        if not is_whole(part):
            return
        yield part
        if opcode == DATA_END:
            return
        offset = part.end


def is_whole(part: Part) -> bool:
    """Whether a part with a checksum, or of a known form, is undamaged."""
    from mcap.exceptions import McapError

    try:
        if part.opcode == CHUNK:
            chunk = read_as("Chunk", part.content)
            # Without one (0) it is a page that was not written. Others may have compressed it.
            return bool(chunk.uncompressed_crc) and (
                bool(chunk.compression) or zlib.crc32(chunk.data) == chunk.uncompressed_crc
            )
        if part.opcode == ATTACHMENT:
            (crc,) = struct.unpack("<I", part.content[-4:])
            return bool(crc == zlib.crc32(part.content[:-4]))
        if part.opcode == MESSAGE:
            return len(part.content) >= _MESSAGE.size
        if part.opcode in _READ:
            read_as(_READ[part.opcode], part.content)
    except (McapError, ValueError, OverflowError, struct.error, EOFError):
        return False
    return True


def read_as(kind: str, content: bytes) -> Any:
    """A part's content, as this class of `mcap.records`."""
    from mcap import records  # here: opening the file says what to install
    from mcap.data_stream import ReadDataStream

    return getattr(records, kind).read(ReadDataStream(BytesIO(content)))


@contextmanager
def damage_of(path: str | Path) -> Iterator[None]:
    """A `ValueError` of a record becomes the `RecordingError` of its file."""
    try:
        yield
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error


def records(path: str | Path) -> Iterator[Record]:
    """The records of the link, in order.

    Raises:
        RecordingError: The file cannot be read, is not a recording, or is from another release.
    """
    check_release(path)
    for topic, _, data in messages(path):
        if topic in TOPICS:
            try:
                yield decode_record(data)
            except ValueError as error:  # no `damage_of`, which takes as long as a record
                raise RecordingError(f"{path}: {error}") from error


def check_release(path: str | Path) -> None:
    """Raise `RecordingError` for a recording of a release whose messages differ."""
    said, ours = metadata(path), f"{schema_hash():08x}"
    if said.get("schema", ours) != ours:
        version = said.get("version", "another release")
        raise RecordingError(
            f"{path} was recorded by Wheelwire {version}, whose messages differ: "
            f"read it with that release"
        )


def session_records(path: str | Path) -> Iterator[Record]:
    """As `records`, but for running the session again.

    Raises:
        RecordingError: As `records`; or the file lacks the session or what was received, and is not
            a recording that has just begun.
    """
    kinds: set[Kind] = set()
    first = last = None
    number = 0
    for record in records(path):
        kinds.add(record.kind)
        first = record.number if first is None else first
        last = record.number
        number += 1
        yield record
    # All records of a link are counted: records that another program left out are missing. A robot
    # that was out of reach all the time has sent nothing, and then no number is missing.
    is_whole = first is not None and last is not None and last - first < number
    if Kind.START not in kinds or not (is_whole or kinds & RECEIVED_KINDS):
        check_left_out(path)


def check_left_out(path: str | Path) -> None:
    """Raise `RecordingError` for a file without what is to be read, unless it has just begun."""
    if not is_being_written(path):
        check_cut_off(path)
        topics = ", ".join(sorted({topic for topic, _, _ in messages(path)}))
        raise RecordingError(
            f"{path}: it lacks data of the link, which takes {RECEIVED}, {SENT} and {SESSION}, and "
            f"its topics are: {topics or 'none'}. Another program left them out, or the recording "
            "ended as it began; name the original"
        )


def check_cut_off(path: str | Path) -> None:
    """Raise `RecordingError` for a file of ours that ends before what is to be read."""
    if is_being_written(path) or was_closed(path):
        return
    if ended := metadata(path).get(ENDED):
        raise RecordingError(f"{path}: its recorder gave up as it began ({ended}); record again")
    with opened(path) as file:
        if is_ours(next(parts(file), None)):
            raise RecordingError(f"{path}: {CUT_OFF}")


def messages(path: str | Path) -> Iterator[tuple[str, int, bytes]]:
    """Each message's topic, its time [ns since 1970] and what it says, in the file's order.

    Raises:
        RecordingError: The file cannot be read.
    """
    topics: dict[int, str] = {}
    with closing(_parts_of(path)) as from_file:
        for part in from_file:
            if part.opcode == CHUNK:
                chunk = read_as("Chunk", part.content)
                if chunk.compression:
                    raise RecordingError(
                        f"{path} was compressed by another program: `mcap decompress` undoes that"
                    )
                data, inner = chunk.data, within(chunk.data)
            else:  # another program may have written it without chunks
                data, inner = part.content, iter(((part.opcode, 0, len(part.content)),))
            for opcode, begin, end in inner:
                if opcode == MESSAGE:
                    channel, _, time_ns, _ = _MESSAGE.unpack_from(data, begin)
                    yield topics.get(channel, ""), time_ns, data[begin + _MESSAGE.size : end]
                elif opcode == CHANNEL:
                    one = read_as("Channel", data[begin:end])
                    topics[one.id] = one.topic


def within(data: bytes) -> Iterator[tuple[int, int, int]]:
    """What a chunk's data hold: each part's opcode, and from where to where its content goes."""
    end = 0
    while end < len(data):
        opcode, length = HEAD.unpack_from(data, end)
        begin = end + HEAD.size
        end = begin + length
        yield opcode, begin, end


def metadata(path: str | Path) -> dict[str, str]:
    """What the recorder wrote at the beginning: version, board, driver, the clock's offset.

    Raises:
        RecordingError: The file cannot be read, or is not a Wheelwire recording.
    """
    with closing(_parts_of(path)) as from_file:
        for part in from_file:
            if part.opcode == METADATA_RECORD and (said := _said(part, METADATA)) is not None:
                ended = said.pop(ENDED, "").strip()
                return said | ({ENDED: ended} if ended else {})
    with opened(path) as file:
        raise unreadable(file, path)


def unreadable(file: BinaryIO, path: str | Path) -> RecordingError:
    """The error of a file that has not even the metadata of a recording."""
    first = next(parts(file), None)
    file.seek(0)
    begin = file.read(len(MAGIC))
    if first is None and not (begin and MAGIC.startswith(begin)):
        return RecordingError(f"{path}: it is not an MCAP file, or it is empty; {_MADE}")
    if first is None or is_ours(first):
        return RecordingError(f"{path}: {CUT_OFF}")
    return RecordingError(f"{path}: it is not a Wheelwire recording; {_MADE}")


def is_ours(first: Part | None) -> bool:
    """Whether a file that begins with this part is a recorder's."""
    if first is None or first.opcode != HEADER:
        return False
    return bool(read_as("Header", first.content).library == LIBRARY)


def offset_us(path: str | Path) -> int:
    """The difference from the host's clock to the time of day.

    If the time of day was set during the recording, as on a Pi without a clock battery, this is the
    last difference. The host's clock runs on evenly, so it is right for the whole file.

    Raises:
        RecordingError: The file cannot be read, or is not a Wheelwire recording.
    """
    text = metadata(path).get(OFFSET, "0")
    with opened(path) as file:
        text = (_newest(file, CLOCK) or {}).get(OFFSET, text)
    # If it is damaged, only the date is lost.
    return int(text) // 1000 if text.lstrip("-").isdecimal() else 0


def counts(path: str | Path) -> dict[str, str] | None:
    """The recorder's counts, from the file's end, without reading its records.

    None for a file without an end, or if another program has left out some of the records.

    Raises:
        RecordingError: The file cannot be opened.
    """
    with opened(path) as file:
        index, said = _index(file), _newest(file, COUNTS)
    if index is None or said is None:
        return None
    ours: set[int] = set()
    counted: dict[int, int] = {}
    for opcode, begin, end in within(index):
        if opcode == CHANNEL:
            channel = read_as("Channel", index[begin:end])
            if channel.topic in TOPICS:
                ours.add(channel.id)
        elif opcode == STATISTICS:
            counted = read_as("Statistics", index[begin:end]).channel_message_counts
    there = sum(counted.get(number, 0) for number in ours)
    return said if said.get("records") == str(there) else None


def _newest(file: BinaryIO, name: str) -> dict[str, str] | None:
    """The last metadata of this name; None if there are none."""
    found = None
    for offset in _metadata_offsets(file):  # without reading what is between them
        file.seek(offset)
        opcode, length = HEAD.unpack(file.read(HEAD.size))
        part = Part(offset, opcode, file.read(length))
        if not is_whole(part):
            break
        found = _said(part, name) or found
    return found


def _metadata_offsets(file: BinaryIO) -> Iterator[int]:
    """Where metadata begin: by the file's index, or from part to part."""
    index = _index(file)
    if index is not None:
        for opcode, begin, end in within(index):
            if opcode == METADATA_INDEX:
                yield read_as("MetadataIndex", index[begin:end]).offset
        return
    size, offset = file.seek(0, os.SEEK_END), len(MAGIC)
    while offset + HEAD.size <= size:
        file.seek(offset)
        opcode, length = HEAD.unpack(file.read(HEAD.size))
        end = offset + HEAD.size + length
        if not HEADER <= opcode < DATA_END or end > size:
            return
        if opcode == METADATA_RECORD:
            yield offset
        offset = end


def _said(part: Part, name: str) -> dict[str, str] | None:
    """What a part with metadata says, if it has this name."""
    found = read_as("Metadata", part.content)
    return dict(found.metadata) if found.name == name else None


def has_end(file: BinaryIO) -> bool:
    """Whether a file ends as a complete one does, the index by its checksum.

    The end is written only after everything before it is on the disk. A file that is growing or
    shrinking has no end yet.
    """
    return _index(file) is not None


def _index(file: BinaryIO) -> bytes | None:
    """The index at a file's end, which MCAP calls its summary; None if it has no such end."""
    size = file.seek(0, os.SEEK_END)
    if size < len(MAGIC) + len(_DATA_END) + _FOOTER.size:
        return None
    file.seek(size - _FOOTER.size)
    footer = file.read()
    if len(footer) != _FOOTER.size:
        return None
    opcode, length, index, _, crc, magic = _FOOTER.unpack(footer)
    begin = index - HEAD.size - 4
    if (opcode, length, magic) != (FOOTER, 20, MAGIC) or not len(MAGIC) <= begin < size:
        return None
    file.seek(begin)
    data = file.read(size - begin - len(MAGIC) - 4)
    summed = data[HEAD.size + 4 :]  # the checksum is of the index and of the footer's beginning
    if not data.startswith(_DATA_END) or crc != zlib.crc32(summed):
        return None
    return summed[: len(MAGIC) + 4 - _FOOTER.size]


def is_complete(path: str | Path) -> bool:
    """Whether a recording is undamaged, with its end.

    Raises:
        RecordingError: The file cannot be read.
    """
    with closing(_parts_of(path)) as from_file:
        if not any(part.opcode == DATA_END for part in from_file):
            return False
    with opened(path) as file:
        return has_end(file)


def was_closed(path: str | Path) -> bool:
    """Whether its recorder closed it, and not a repair.

    Raises:
        RecordingError: The file cannot be read.
    """
    with closing(_parts_of(path)) as from_file:
        is_repaired = any(
            part.opcode == METADATA_RECORD and _said(part, REPAIRED) is not None
            for part in from_file
        )
    return not is_repaired and is_complete(path)


def was_cut(path: str | Path) -> bool:
    """Whether the recording was cut off: not closed, not given up, and no longer being written.

    Raises:
        RecordingError: The file cannot be read.
    """
    return not (is_being_written(path) or ENDED in metadata(path) or was_closed(path))


def is_being_written(path: str | Path) -> bool:
    """Whether a recorder, or a repair, has the file now."""
    with opened(path) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def opened(path: str | Path, mode: str = "rb") -> BinaryIO:
    """A recording's file.

    Raises:
        RecordingError: It cannot be opened.
    """
    require_mcap()
    try:
        if stat.S_ISREG(Path(path).stat().st_mode):
            return cast("BinaryIO", Path(path).open(mode, buffering=BUFFER))
        reason = "it is not a file"  # to open a port or a pipe would wait
    except OSError as error:
        reason = error.strerror or str(error)
    raise RecordingError(f"cannot open {path}: {reason}; name a recording, FILE.mcap")


def _parts_of(path: str | Path) -> Generator[Part, None, None]:
    with opened(path) as file:
        found = False
        for part in parts(file):
            found = True
            yield part
        if not found:
            raise unreadable(file, path)
