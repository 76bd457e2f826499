"""Writes the end of a recording that a crash or a power cut has left without one.

Undamaged records stay where they are. The repair cuts off only what the crash has damaged, and
writes the index behind the rest.
"""

from __future__ import annotations

import fcntl
import logging
import os
import re
import struct
import time
import zlib
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from ..errors import RecordingError
from . import reader

if TYPE_CHECKING:
    from mcap.records import AttachmentIndex, Channel, ChunkIndex, MetadataIndex, Schema

PAUSE_S = 0.01
"""Pause after each chunk, so as not to disturb a robot that is being driven."""
LARGEST_REST = 4 << 20
"""A crash can damage less than this: the last second."""
_MESSAGE = struct.Struct("<HIQ")
"""How a message begins: channel, sequence, time."""
_LOG = logging.getLogger("wheelwire")
LATEST_NS = 10_000_000_000
"""Within this time of the newest synced message a power cut may destroy what it likes: a slow disk
takes seconds for a sync."""
_CHUNK_HEAD = re.compile(rb"(?=\x06[\0-\xff]{3}[\0-\x0f]\0{4})")
"""Where a chunk may begin: its opcode, and a length below 256 MiB."""


@dataclass
class _Found:
    """What a file holds, and where."""

    end: int = len(reader.MAGIC)
    """The end of what is undamaged."""
    is_complete: bool = False
    tail: bytes = b""
    """The index of the last chunk, if it is missing behind `end`."""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=lambda: defaultdict(int))
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)


def repair(path: str | Path) -> bool:
    """Make a recording complete. False if it was.

    Raises:
        RecordingError: It is being recorded, is not a recording, or is damaged in its middle.
    """
    try:
        with reader.opened(path, "r+b") as file:
            _lock(file, path)
            if not reader.is_ours(next(reader.parts(file), None)):
                raise reader.unreadable(file, path)
            return _repaired(file, path, 0.0)
    except OSError as error:
        raise RecordingError(
            f"cannot repair {path}: {error.strerror}; check its permissions and the free space"
        ) from error


def repair_folder(folder: Path) -> None:
    """Repair every recording of ours here that is not being written."""
    for path in sorted(folder.glob("*.mcap")):
        try:
            with path.open("r+b") as file:
                if reader.has_end(file) or not reader.is_ours(next(reader.parts(file), None)):
                    continue
                _lock(file, path)
                if _repaired(file, path, PAUSE_S):  # its recorder has not closed it since
                    _LOG.info("repaired %s, which had no end", path)
        except RecordingError as error:
            if not isinstance(error, _BeingWritten):
                _LOG.warning("%s", error)
        except OSError as error:
            _LOG.warning("cannot repair %s: %s", path, error.strerror)


def _repaired(file: BinaryIO, path: str | Path, pause_s: float) -> bool:
    found = _found(file, pause_s)
    if not found.is_complete:
        _finish(file, found, path)
    return not found.is_complete


class _BeingWritten(RecordingError):  # noqa: N818 - it says the state
    """Another program writes the file."""


def _lock(file: BinaryIO, path: str | Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise _BeingWritten(
            f"{path} is being written, by a recording or a repair: end that first"
        ) from None


def _found(file: BinaryIO, pause_s: float) -> _Found:
    """Look through the file, up to the first damage."""
    found = _Found()
    awaited: list[bytes] = []
    """What has to follow: the index of the chunk before, one part for each channel."""
    for part in reader.parts(file):
        if part.opcode == reader.MESSAGE_INDEX and awaited[:1] == [part.content]:
            del awaited[0]
        elif part.opcode == reader.MESSAGE_INDEX or awaited:
            break
        elif part.opcode == reader.CHUNK:
            awaited = _take_chunk(found, part)
            time.sleep(pause_s)
        elif part.opcode in (reader.ATTACHMENT, reader.METADATA_RECORD):
            _take_other(found, part)
        elif part.opcode == reader.DATA_END:
            found.is_complete = reader.has_end(file)
            break
        found.end = part.end
    for content in awaited:
        found.tail += reader.HEAD.pack(reader.MESSAGE_INDEX, len(content)) + content
    return found


def _take_chunk(found: _Found, part: reader.Part) -> list[bytes]:
    """Note a chunk; returns its messages' index, as it has to follow."""
    from mcap.records import ChunkIndex

    chunk = reader.read_as("Chunk", part.content)
    indexes = _indexes(found, chunk.data)
    places: dict[int, int] = {}
    offset = part.end
    contents = []
    for channel, entries in indexes.items():
        contents.append(struct.pack(f"<HI{len(entries)}Q", channel, 8 * len(entries), *entries))
        places[channel] = offset
        offset += reader.HEAD.size + len(contents[-1])
        found.counts[channel] += len(entries) // 2
    found.chunks.append(
        ChunkIndex(
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            chunk_start_offset=part.offset,
            chunk_length=part.end - part.offset,
            message_index_offsets=places,
            message_index_length=offset - part.end,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
        )
    )
    return contents


def _indexes(found: _Found, data: bytes) -> dict[int, list[int]]:
    """Each channel's messages in a chunk: time, offset, time, offset, ..."""
    indexes: dict[int, list[int]] = {}
    for opcode, begin, end in reader.within(data):
        if opcode == reader.MESSAGE:
            channel, _, time_ns = _MESSAGE.unpack_from(data, begin)
            indexes.setdefault(channel, []).extend((time_ns, begin - reader.HEAD.size))
        elif opcode == reader.SCHEMA:
            schema = reader.read_as("Schema", data[begin:end])
            found.schemas[schema.id] = schema
        elif opcode == reader.CHANNEL:
            one = reader.read_as("Channel", data[begin:end])
            found.channels[one.id] = one
    return indexes


def _take_other(found: _Found, part: reader.Part) -> None:
    from mcap.records import AttachmentIndex, MetadataIndex

    length = part.end - part.offset
    if part.opcode == reader.METADATA_RECORD:
        name = reader.read_as("Metadata", part.content).name
        found.metadata.append(MetadataIndex(part.offset, length, name))
    else:
        one = reader.read_as("Attachment", part.content)
        found.attachments.append(
            AttachmentIndex(
                offset=part.offset,
                length=length,
                log_time=one.log_time,
                create_time=one.create_time,
                data_size=len(one.data),
                name=one.name,
                media_type=one.media_type,
            )
        )


def _finish(file: BinaryIO, found: _Found, path: str | Path) -> None:
    """Cut off what is damaged, and write what is missing."""
    file.seek(found.end)
    behind = file.read()
    rest = behind.strip(b"\0")  # pages that were never written read as zeros
    if (other := behind.find(reader.MAGIC + bytes([reader.HEADER]))) >= 0:
        at = found.end + other
        raise RecordingError(
            f"{path} holds another recording {at} bytes from its beginning, which a repair would "
            f"lose, so nothing was changed: `tail -c +{at + 1} {path} > other.mcap` takes it out, "
            f"and then `truncate -s {at} {path}`"
        )
    if len(rest) > LARGEST_REST or _is_later(rest, found):
        raise RecordingError(
            f"{path} is damaged {found.end} bytes from its beginning, not at its end as by a "
            f"crash: a repair would lose the {len(rest)} bytes behind that, so nothing was changed"
        )
    file.seek(found.end)
    file.truncate()
    offset = found.end + len(found.tail)
    mark = _mark(found, offset)
    file.write(found.tail + mark)
    file.flush()
    os.fsync(file.fileno())  # first: a file that has an end is whole
    file.write(_end(found, offset + len(mark)))
    file.flush()
    os.fsync(file.fileno())


def _is_later(rest: bytes, found: _Found) -> bool:
    """Whether an undamaged chunk behind the damage is of later than what a crash destroys."""
    newest_ns = max((chunk.message_end_time for chunk in found.chunks), default=None)
    for begin in _CHUNK_HEAD.finditer(rest):
        opcode, length = reader.HEAD.unpack_from(rest, begin.start())
        content = rest[begin.start() + reader.HEAD.size :][:length]
        part = reader.Part(begin.start(), opcode, content)
        if len(content) == length and reader.is_whole(part):
            chunk = reader.read_as("Chunk", part.content)
            # If a file was cut within its first second, nothing before this may be undamaged.
            newest_ns = chunk.message_start_time if newest_ns is None else newest_ns
            if chunk.message_end_time > newest_ns + LATEST_NS:
                return True
    return False


def _mark(found: _Found, offset: int) -> bytes:
    """The metadata that say that a repair wrote the end."""
    from mcap.data_stream import RecordBuilder
    from mcap.records import Metadata, MetadataIndex

    builder = RecordBuilder()
    Metadata(name=reader.REPAIRED, metadata={}).write(builder)
    mark: bytes = builder.end()
    found.metadata.append(MetadataIndex(offset, len(mark), reader.REPAIRED))
    return mark


def _end(found: _Found, offset: int) -> bytes:
    """The end of the data, the summary and the footer of a file that goes to `offset`."""
    from mcap.data_stream import RecordBuilder
    from mcap.records import DataEnd, Footer, Statistics

    statistics = Statistics(
        attachment_count=len(found.attachments),
        channel_count=len(found.channels),
        channel_message_counts=dict(found.counts),
        chunk_count=len(found.chunks),
        message_count=sum(found.counts.values()),
        message_end_time=max((chunk.message_end_time for chunk in found.chunks), default=0),
        message_start_time=min((chunk.message_start_time for chunk in found.chunks), default=0),
        metadata_count=len(found.metadata),
        schema_count=len(found.schemas),
    )
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    begin = builder.count
    for one in (
        *found.schemas.values(),
        *found.channels.values(),
        statistics,
        *found.chunks,
        *found.attachments,
        *found.metadata,
    ):
        one.write(builder)
    data = builder.end()
    # The checksum is of the summary and the footer's beginning.
    head = struct.pack("<BQQQ", reader.FOOTER, 20, offset + begin, 0)
    crc = zlib.crc32(head, zlib.crc32(data[begin:]))
    Footer(summary_start=offset + begin, summary_offset_start=0, summary_crc=crc).write(builder)
    return bytes(data + builder.end() + reader.MAGIC)
