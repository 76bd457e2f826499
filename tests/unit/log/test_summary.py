"""The summary of a recording: by what the file's end says, as if all of it had been read."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from pathlib import Path

import pytest

from support.tapped_line import TappedLine
from wheelwire.link.traffic import Kind, Record, TrafficReader
from wheelwire.log.recorder import RecordingFile
from wheelwire.log.summary import summary
from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.types import Stop

MEGABYTES = 3


@pytest.fixture(scope="module")
def drive() -> list[Record]:
    """A drive of a second, of which a read of the port is missing."""
    link, reader = TappedLine(), TrafficReader()
    link.listen_to_traffic(reader)
    link.drive(1.0)
    records = reader.take()
    received = [record for record in records if record.kind is Kind.RECEIVED]
    records.remove(received[len(received) // 2])
    return [*records, Record(0, Kind.SENT, 0, encode_frame(Stop(0, 0, 0, StopMode.COAST), 0))]


def written(path: Path, drive: list[Record], size: int) -> RecordingFile:
    """The same drive again and again, until the file has this size."""
    file = RecordingFile(path, 0, {"driver": "mock"})
    numbers, host_us = count(), 0
    while file.size < size:
        for record in drive:
            host_us += 1000
            file.add(record._replace(number=next(numbers), host_us=host_us))
    return file


def bytes_read() -> int:
    """By this process since its start."""
    return int(Path("/proc/self/io").read_text("ascii").split()[1])


def test_it_reads_the_end_and_gives_what_the_whole_file_does(
    drive: list[Record], tmp_path: Path
) -> None:
    file = written(tmp_path / "day.mcap", drive, MEGABYTES << 20)
    file.sync()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.path.read_bytes())
    file.close()
    before = bytes_read()
    in_full = summary(cut)
    between = bytes_read()
    by_its_end = summary(file.path)
    after = bytes_read()
    assert by_its_end.complete
    assert by_its_end.frames_received > 1000
    assert by_its_end.frames_sent == by_its_end.frames_lost > 10
    assert by_its_end.duration_s > 1
    known = replace(in_full, complete=True, size_bytes=by_its_end.size_bytes)
    assert by_its_end == known
    assert not in_full.complete
    assert between - before > MEGABYTES << 20
    assert after - between < 64 << 10
