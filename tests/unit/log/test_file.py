"""The file of a recording: what was added is read again, however the writing ended."""

from __future__ import annotations

import io
import re
import subprocess
from pathlib import Path
from random import Random
from typing import BinaryIO

import pytest

from support.recordings import OFFSET_NS, SAID, write
from wheelwire.errors import RecordingError
from wheelwire.link.traffic import Kind, Record
from wheelwire.log import repair as repair_module
from wheelwire.log.reader import has_end, metadata, records, was_closed
from wheelwire.log.recorder import RecordingFile, free_path
from wheelwire.log.repair import repair, repair_folder
from wheelwire.log.summary import summary

RECORDS = [Record(number, Kind(number % 16), number * 1000, bytes(number)) for number in range(99)]


def begin(path: Path) -> RecordingFile:
    return RecordingFile(path, OFFSET_NS, {"driver": "mock"})


def add(file: RecordingFile, these: list[Record]) -> None:
    for record in these:
        file.add(record)


def test_what_was_added_is_read(tmp_path: Path) -> None:
    path = write(tmp_path / "day.mcap", RECORDS)
    assert list(records(path)) == RECORDS
    assert metadata(path) == {**SAID, "unix_minus_monotonic_ns": str(OFFSET_NS)}


def test_without_an_end_it_reads_up_to_the_last_sync(tmp_path: Path) -> None:
    file = begin(tmp_path / "day.mcap")
    add(file, RECORDS[:50])
    file.sync()
    add(file, RECORDS[50:])
    assert list(records(file.path)) == RECORDS[:50]
    file.abandon()


@pytest.mark.parametrize("change", [b"a record more", b""], ids=["grows", "shrinks"])
def test_a_file_that_another_program_changes_meanwhile_has_no_end(change: bytes) -> None:
    class Changed(io.BytesIO):
        def seek(self, offset: int, whence: int = 0) -> int:
            at = super().seek(offset, whence)
            if whence == io.SEEK_END:
                self.truncate(at - 1)
                self.write(change)
            return at

    assert not has_end(Changed(bytes(1000)))


def test_a_recording_that_ends_as_the_folder_is_repaired_stays_as_it_was_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = begin(tmp_path / "day.mcap")
    add(file, RECORDS)
    file.sync()
    lock = repair_module._lock

    def close_and_lock(opened: BinaryIO, path: str | Path) -> None:
        file.close()
        lock(opened, path)

    monkeypatch.setattr(repair_module, "_lock", close_and_lock)
    repair_folder(tmp_path)
    assert was_closed(file.path)
    assert list(records(file.path)) == RECORDS


def test_once_closed_it_closes_no_other_file(tmp_path: Path) -> None:
    """As in a child that is forked later, which abandons what it does not own."""
    file = begin(tmp_path / "day.mcap")
    file.close()
    with (tmp_path / "another").open("wb") as another:  # has the number that is free now
        file.abandon()
        another.write(b"here")
    assert (tmp_path / "another").read_bytes() == b"here"


def test_it_overwrites_nothing(tmp_path: Path) -> None:
    path = tmp_path / "day.mcap"
    path.write_text("precious")
    with pytest.raises(FileExistsError):
        begin(path)
    assert path.read_text() == "precious"
    assert free_path(path) == tmp_path / "day-2.mcap"
    (tmp_path / "day-2.mcap").touch()
    assert free_path(path) == tmp_path / "day-3.mcap"


def test_a_damaged_file_is_read_up_to_the_damage_or_refused(tmp_path: Path) -> None:
    file = begin(tmp_path / "day.mcap")
    for number in range(0, 99, 20):
        add(file, RECORDS[number : number + 20])
        file.sync()
    file.close()
    whole, random = file.path.read_bytes(), Random(5)
    damaged, refused = tmp_path / "damaged.mcap", 0
    for _ in range(400):
        data = bytearray(whole)
        for _ in range(random.choice((1, 5))):
            # Half of them at the beginning, which has no checksum.
            at = random.randrange(random.choice((600, len(data))))
            size = random.choice((1, 4, 200))
            data[at : at + size] = random.choice((b"", random.randbytes(size)))
        damaged.write_bytes(data)
        for read in (lambda path: list(records(path)), summary, repair, metadata):
            try:
                found = read(damaged)
            except RecordingError:
                refused += 1
                continue
            assert not isinstance(found, list) or found == RECORDS[: len(found)]
    assert 200 < refused < 1400


def drive(path: Path, first_s: int, seconds: int) -> RecordingFile:
    """A recording with a chunk for each second."""
    file = begin(path)
    for second in range(first_s, first_s + seconds):
        add(file, [Record(n, Kind.NOTE, second * 1_000_000 + n, b"{}") for n in range(20)])
        file.sync()
    return file


@pytest.mark.parametrize("ends", [True, False], ids=["closed", "cut"])
def test_a_repair_loses_no_second_recording_in_a_file(tmp_path: Path, *, ends: bool) -> None:
    files = [drive(tmp_path / f"{name}.mcap", 0, 3) for name in "ab"]
    for file in files:
        file.close() if ends else file.abandon()
    both = tmp_path / "both.mcap"
    both.write_bytes(files[0].path.read_bytes() + files[1].path.read_bytes())
    before = both.read_bytes()
    with pytest.raises(RecordingError, match="holds another recording") as raised:
        repair(both)
    repair_folder(tmp_path)
    assert both.read_bytes() == before
    # What the message says brings both back.
    for command in re.findall(r"`(.+?)`", str(raised.value)):
        subprocess.run(["sh", "-c", command], check=True, cwd=tmp_path)
    for path in (both, tmp_path / "other.mcap"):
        repair(path)
        assert len(list(records(path))) == 60


def test_a_repair_loses_no_chunk_behind_damage_in_the_middle(tmp_path: Path) -> None:
    file = drive(tmp_path / "day.mcap", 0, 40)
    file.close()
    data = bytearray(file.path.read_bytes())
    data[len(data) // 4] ^= 0x55
    file.path.write_bytes(data)
    with pytest.raises(RecordingError, match="not at its end as by a crash"):
        repair(file.path)
    assert file.path.read_bytes() == data
