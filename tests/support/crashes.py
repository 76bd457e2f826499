"""Recordings that end by a kill or a power cut, and what can be read of them afterwards."""

from __future__ import annotations

import json
import os
import shutil
import signal
import struct
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from unittest import mock

from mcap.exceptions import McapError
from mcap.reader import make_reader

from support.tapped_line import TappedLine
from wheelwire.errors import RecordingError
from wheelwire.link.traffic import Kind, Record, TrafficReader
from wheelwire.log import recorder as recorder_module
from wheelwire.log.reader import TOPICS, decode_record, is_complete, records
from wheelwire.log.recorder import Attachment, Recorder, RecordingFile
from wheelwire.log.repair import repair

STEP_S = 0.05
LONGEST_S = 2.6
"""Until a kill, in time of the recorded robot: two syncs, ten chunks."""
AT_ONCE = 10
PAGE = 4096
MEMORY = Path("/dev/shm")  # noqa: S108 - a folder of its own is made there
_PART = struct.Struct("<BQ")


@contextmanager
def folder_in_memory() -> Iterator[Path]:
    """A folder whose files cost no time of a disk, where the system has one."""
    with TemporaryDirectory(dir=MEMORY if os.access(MEMORY, os.W_OK) else None) as folder:
        yield Path(folder)


@dataclass
class Left:
    """What is left of a recording.

    Attributes:
        what: What ended it.
        recorded: How many of the link's records can be read.
        lost_s: The age of the oldest one that cannot.
        problem: What is wrong, or nothing.
    """

    what: str
    recorded: int = 0
    lost_s: float = 0.0
    problem: str = ""


# --- kills -------------------------------------------------------------------------------------


class Seen(NamedTuple):
    """A record, as another listener has it, and before when it was made."""

    time_s: float
    record: Record


def kills(count: int, seed: int, folder: Path) -> Iterator[Left]:
    """Record in a process, and kill it at a random moment; so many times.

    The calling process must have no other thread: it is forked.
    """
    random = Random(seed)
    for begin in range(0, count, AT_ONCE):
        places = [folder / str(number) for number in range(begin, min(begin + AT_ONCE, count))]
        running = sorted(
            (random.uniform(0.0, LONGEST_S), _started(place, random.getrandbits(32)), place)
            for place in places
        )
        killed = []
        for after_s, pid, place in running:
            # By what the process has done: a busy computer makes it slow.
            while _steps(place) < after_s // STEP_S:
                time.sleep(STEP_S / 10)
            time.sleep(after_s % STEP_S)
            os.kill(pid, signal.SIGKILL)
            _, status = os.waitpid(pid, 0)
            killed.append((time.monotonic(), status, after_s, place))
        for moment, status, after_s, place in killed:
            found = Left(f"killed after {after_s:.3f} s")
            if os.WIFSIGNALED(status):
                _look(found, place, moment)
            else:
                found.problem = f"the process has ended by itself: {status}"
            yield found
            shutil.rmtree(place)


def _steps(place: Path) -> int:
    """How many steps of the robot a process has recorded."""
    path = place / "steps"
    return path.stat().st_size if path.exists() else 0


def _started(place: Path, seed: int) -> int:
    place.mkdir()
    pid = os.fork()
    if not pid:
        try:
            _record_until_killed(place, Random(seed))
        finally:
            os._exit(1)
    return pid


def _record_until_killed(place: Path, random: Random) -> None:
    link = TappedLine()
    witness = TrafficReader(limit=1_000_000)
    link.listen_to_traffic(witness)
    recorder_module.MAX_BYTES = random.choice((1, 1 << 30))
    seen, steps = (os.open(place / name, os.O_CREAT | os.O_WRONLY) for name in ("seen", "steps"))
    recorder = Recorder(link, place / "day.mcap", {})
    while recorder.error is None:
        time_s = time.monotonic()
        link.drive(STEP_S, random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3))
        for number, kind, host_us, data in witness.take():
            line = json.dumps([time_s, number, kind, host_us, data.hex()])
            os.write(seen, f"{line}\n".encode())
        os.write(steps, b".")
        time.sleep(STEP_S)


def _all_seen(place: Path) -> list[Seen]:
    path, found = place / "seen", []
    # The last line may be a part of one.
    for line in path.read_text().split("\n")[:-1] if path.exists() else ():
        time_s, number, kind, host_us, data = json.loads(line)
        found.append(Seen(time_s, Record(number, Kind(kind), host_us, bytes.fromhex(data))))
    return found


def _is_a_beginning(record: Record) -> bool:
    """That somebody begins to listen: another listener has an empty note in its place."""
    return record.kind is Kind.START or (record.kind is Kind.NOTE and record.data == b"{}")


def _look(found: Left, place: Path, moment: float) -> None:
    """Repair and read what a kill left, and compare it with what another listener has."""
    files = sorted(place.glob("*.mcap"), key=_part_of)
    recorded = [record for file in files for record in after_repair(file)]
    seen = _all_seen(place)
    if recorded:
        began = recorded[0].number
        seen = [one for one in seen if one.record.number > began]
    recorded = [one for one in recorded if not _is_a_beginning(one)]
    seen = [one for one in seen if not _is_a_beginning(one.record)]
    found.recorded = len(recorded)
    # The witness writes down what it has a moment after the recorder could.
    both = min(len(recorded), len(seen))
    if recorded[:both] != [one.record for one in seen[:both]]:
        found.problem = "other records than those of the link"
    if missing := seen[both:]:
        found.lost_s = moment - missing[0].time_s
    if found.lost_s > 1.0:
        found.problem = f"{found.lost_s:.2f} s are lost"


def _part_of(file: Path) -> int:
    return int(file.stem.partition("-")[2] or 1)


# --- what is left ------------------------------------------------------------------------------


def after_repair(path: Path) -> list[Record]:
    """What can be read of a file. Its repair changes nothing of that, and others can read it then.

    Raises:
        AssertionError: It does, or they cannot.
    """
    try:
        found = list(records(path))
    except RecordingError:
        return []  # nothing of it was written; whether that may be, its caller knows
    repair(path)
    assert is_complete(path), "the repair has left it without an end"
    assert not repair(path), "repaired twice"
    assert list(records(path)) == found, "the repair has changed what can be read"
    try:
        raws = _read_by_others(path)
    except (McapError, ValueError) as error:
        raise AssertionError(f"others cannot read it: {error!r}") from error
    assert raws == found, "others read something else"
    return found


def _read_by_others(path: Path) -> list[Record]:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        messages = [(channel.topic, message.data) for _, channel, message in reader.iter_messages()]
        assert summary.statistics.message_count == len(messages)
        assert len(list(reader.iter_attachments())) == summary.statistics.attachment_count
    return [decode_record(data) for topic, data in messages if topic in TOPICS]


# --- power cuts --------------------------------------------------------------------------------


class Disk:
    """What a program has written to one file, and up to where it was synced, at each moment.

    Stands in for `os` in the recorder. A recording only grows, so its length says all.

    Attributes:
        moments: The length, and the length that was synced.
    """

    def __init__(self) -> None:
        self.moments: list[tuple[int, int]] = [(0, 0)]

    def __getattr__(self, name: str) -> Any:
        return getattr(os, name)

    def write(self, descriptor: int, data: memoryview) -> int:
        # In parts, between which the power may fail, too.
        written = os.write(descriptor, data[: 3 * PAGE])
        self.moments.append((self.moments[-1][0] + written, self.moments[-1][1]))
        return written

    def fdatasync(self, descriptor: int) -> None:
        os.fdatasync(descriptor)
        self.moments.append((self.moments[-1][0],) * 2)


def day(folder: Path, seconds: float = 4.0) -> tuple[Path, list[tuple[int, int]]]:
    """Record a robot, to the end; returns the file, and its moments (`Disk.moments`)."""
    disk, random = Disk(), Random(1)
    with mock.patch.object(recorder_module, "os", disk):
        link = TappedLine()
        recorder = Recorder(
            *(link, folder / "day.mcap", {"driver": "mock"}),
            attachments=lambda: [Attachment("board.yaml", "application/yaml", b"x" * 3 * PAGE)],
        )
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            link.drive(STEP_S, random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3))
            time.sleep(STEP_S / 2)
        recorder.close()
    return recorder.file, disk.moments


def power_cuts(
    count: int, seed: int, path: Path, moments: Sequence[tuple[int, int]]
) -> Iterator[Left]:
    """`count` power cuts, each with some of the pages on the disk that were not synced.

    First every subset of the pages that the file's end is on.
    """
    random = Random(seed)
    whole, truth = path.read_bytes(), list(records(path))
    certain = {synced: _records_in(whole[:synced], path) for synced in {s for _, s in moments}}
    unsynced = [(written, synced) for written, synced in moments if written > synced]

    def cut(written: int, synced: int, subset: Sequence[bool], end: int) -> Left:
        what = f"cut at {written}, {synced} synced"
        data = _after_a_cut(whole[:written], synced, subset)[:end]
        return _judged(what, path, data, truth, certain[synced], len(truth))

    written, synced = unsynced[-1]
    for subset in product((False, True), repeat=len(_pages(written, synced))):
        yield cut(written, synced, subset, written)
    for _ in range(count):
        written, synced = random.choice(unsynced)
        share = random.choice((0.1, 0.5, 0.9))
        subset = tuple(random.random() < share for _ in _pages(written, synced))
        # Its length may be there or not, too.
        ends = [written, written, synced, *_pages(written, synced)[1:]]
        yield cut(written, synced, subset, random.choice(ends))


def _pages(written: int, synced: int) -> range:
    """Where those begin that were not synced, or not to their end."""
    return range(synced // PAGE * PAGE, written, PAGE)


def _after_a_cut(data: bytes, synced: int, subset: Sequence[bool]) -> bytes:
    """The file with each of these pages as it was written, or else as it was synced."""
    found = bytearray(data[:synced].ljust(len(data), b"\0"))
    for page, is_written in zip(_pages(len(data), synced), subset, strict=True):
        if is_written:
            found[page : page + PAGE] = data[page : page + PAGE]
    return bytes(found)


def _judged(
    what: str, beside: Path, data: bytes, truth: list[Record], least: int, most: int
) -> Left:
    """What a file with this data holds: so many of the true records, and no others."""
    path = beside.with_name("cut.mcap")
    path.write_bytes(data)
    try:
        found = after_repair(path)
    except AssertionError as error:
        return Left(what, problem=str(error))
    problem = ""
    if found != truth[: len(found)]:
        problem = "other records than those of the link"
    elif not least <= len(found) <= most:
        problem = f"{len(found)} records, not {least} to {most}"
    return Left(what, len(found), problem=problem)


def _records_in(data: bytes, beside: Path) -> int:
    path = beside.with_name("certain.mcap")
    path.write_bytes(data)
    return len(list(records(path))) if data else 0


# --- prefixes ----------------------------------------------------------------------------------


def short_file(folder: Path) -> Path:
    """A complete recording of some kilobytes, with everything that one can hold."""
    file = RecordingFile(folder / "short.mcap", 1_700_000_000_000_000_000, {"driver": "mock"})
    for number in range(12):
        file.add(Record(number, Kind.NOTE, number * 1000, bytes([number]) * number))
        if number % 4 == 3:
            file.sync()
        if number == 5:
            file.attach("board.yaml", "application/yaml", b"pins: {}\n", 1)
    file.close()
    return file.path


def prefixes(path: Path, step: int = 1) -> Iterator[Left]:
    """Every length at which the file may end, or each `step`th."""
    whole, truth = path.read_bytes(), list(records(path))
    counts = _counts(whole)
    for length in range(0, len(whole) + 1, step):
        expected = max((count for end, count in counts if end <= length), default=0)
        yield _judged(f"ended at {length}", path, whole[:length], truth, expected, expected)


def _counts(data: bytes) -> list[tuple[int, int]]:
    """Where each chunk of a file ends, and how many messages there are up to there."""
    counts, offset, count = [], 8, 0
    while offset + _PART.size <= len(data):
        opcode, length = _PART.unpack_from(data, offset)
        begin = offset + _PART.size
        offset = begin + length
        if opcode == 6:  # a chunk; its records begin behind 40 bytes, for it is not compressed
            inner = begin + 40
            while inner < offset:
                kind, size = _PART.unpack_from(data, inner)
                count += kind == 5  # a message
                inner += _PART.size + size
            counts.append((offset, count))
    return counts
