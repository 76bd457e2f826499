"""`wheelwire log`: what a recording holds, for people and for programs; and every wrong file."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from mcap.writer import CompressionType, Writer

from support.cases import each
from support.command import PROGRAM, check_error, output, run, run_json
from support.processes import captured
from support.recordings import OFFSET_NS, rewritten, traffic_of, write
from wheelwire import errors
from wheelwire.cli import log
from wheelwire.cli.app import application
from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.link.traffic import Kind, Record
from wheelwire.log.reader import MAGIC, records

SPEEDS = [0.02 * step for step in range(20)]


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of a drive in virtual time, one second long, with an e-stop at its end."""

    def play(robot: VirtualMockDriver) -> None:
        for speed in SPEEDS:
            robot.set_velocity(speed, 0.0)
            robot.advance(0.05)
        robot.estop()
        robot.advance(0.1)

    return write(tmp_path_factory.mktemp("day") / "day.mcap", traffic_of(play))


def test_info(day: Path) -> None:
    said = run_json("log", "info", str(day))
    sent = [
        frame  # some records have several
        for record in records(day)
        if record.kind is Kind.SENT
        for frame in record.data.split(b"\0")
        if frame
    ]
    assert said["board_id"] == "0a1b2c3d4e5f"
    assert said["complete"] is True
    assert said["frames_lost"] == 0
    assert said["frames_sent"] == len(sent) > len(SPEEDS)
    assert 1.0 < said["duration_s"] < 1.3
    assert said["frames_received"] > 100
    assert said["size_bytes"] == day.stat().st_size
    text = output("log", "info", str(day))
    assert "0a1b2c3d4e5f, driver mock" in text
    assert "yes" in text


def test_info_of_what_a_crash_left_says_how_to_repair_it(day: Path, tmp_path: Path) -> None:
    path = tmp_path / "torn.mcap"
    path.write_bytes(day.read_bytes()[:-2000])
    before = run_json("log", "info", str(path))
    assert before["complete"] is False
    assert "log repair" in output("log", "info", str(path))
    assert run_json("log", "repair", str(path)) == {"file": str(path), "repaired": True}
    after = run_json("log", "info", str(path))
    assert after["complete"] is True
    assert after["frames_received"] == before["frames_received"]
    assert "nothing was changed" in output("log", "repair", str(path))


def test_decode_every_message(day: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(output("log", "decode", str(day)))))
    said = run_json("log", "info", str(day))
    sent = [row for row in rows if row["direction"] == "sent"]
    assert len(sent) == said["frames_sent"]
    assert len(rows) - len(sent) == said["frames_received"]
    first = next(row for row in rows if row["message"] == "SetWheelVelocity")
    assert "left_mps=0 right_mps=0" in first["values"]
    assert float(first["unix_s"]) - float(first["host_s"]) == pytest.approx(OFFSET_NS / 1e9)


def test_decode_one_message(day: Path) -> None:
    text = output("log", "decode", str(day), "--message", "SetWheelVelocity")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [row["left_mps"] for row in rows] == [f"{speed:g}" for speed in SPEEDS]
    assert [row["direction"] for row in rows] == ["sent"] * len(SPEEDS)
    lines = output("log", "decode", str(day), "--message", "SetWheelVelocity", "--json")
    values = [json.loads(line) for line in lines.splitlines()]
    assert [value["left_mps"] for value in values] == [float(row["left_mps"]) for row in rows]


def test_text_in_a_message_is_readable(day: Path) -> None:
    """The device sends names as bytes of a fixed size."""
    for line in output("log", "decode", str(day), "--json").splitlines():
        json.loads(line)


def test_a_message_that_there_is_not(day: Path) -> None:
    result = run("log", "decode", str(day), "--message", "wheelstate")
    assert "WheelState" in check_error(result, errors.InvalidArgument)


def test_a_pipe_that_is_closed_early(day: Path) -> None:
    with subprocess.Popen(
        [*PROGRAM, "log", "decode", str(day)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_plot(day: Path, tmp_path: Path) -> None:
    picture = tmp_path / "seen.png"
    assert run_json("log", "plot", str(day), "--output", str(picture)) == {"picture": str(picture)}
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "drew" in output("log", "plot", str(day))
    assert day.with_suffix(".png").exists()


@pytest.mark.parametrize(
    ("name", "error", "text"),
    [
        ("none/day.png", errors.OutputFailed, "cannot write"),
        ("day.abc", errors.InvalidArgument, "name it .png"),
    ],
)
def test_a_picture_that_cannot_be_drawn(
    day: Path, tmp_path: Path, name: str, error: type[errors.WheelwireError], text: str
) -> None:
    result = run("log", "plot", str(day), "--output", str(tmp_path / name))
    assert text in check_error(result, error)
    assert not list(tmp_path.iterdir())


def without(module: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """The command where a package is not installed."""
    code = f"import sys; sys.modules[{module!r}] = None; from wheelwire.cli import main; main()"
    return captured(sys.executable, "-c", code, *arguments)


@pytest.mark.whole
def test_the_extras_are_named(day: Path, tmp_path: Path) -> None:
    result = without("matplotlib", "log", "plot", str(day))
    assert "pip install 'wheelwire[tools]'" in check_error(result, errors.DriverUnavailable)
    for command in (("info", str(day)), ("record", "mock", str(tmp_path / "a.mcap"))):
        result = without("mcap.records", "log", *command)
        assert "pip install 'wheelwire[record]'" in check_error(result, errors.RecordingError)


def foreign(path: Path, compression: CompressionType) -> Path:
    """A recording by somebody else."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start("ros2", "elsewhere")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/chatter", "cdr", schema)
        writer.add_message(channel, 1, b"\0\1\0\0\1\0\0\0\0", 1)
        writer.finish()
    return path


@pytest.fixture(
    params=["missing", "folder", "pipe", "text", "empty", "magic", "foreign", "lz4", "zstd"]
)
def wrong(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """No recording."""
    path = tmp_path / "wrong.mcap"
    kind: str = request.param
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind in ("text", "empty", "magic"):
        path.write_bytes({"text": b"hello", "empty": b"", "magic": MAGIC}[kind])
    elif kind != "missing":
        names = {"foreign": "NONE", "lz4": "LZ4", "zstd": "ZSTD"}
        foreign(path, CompressionType[names[kind]])
    return path


def refused(*arguments: str) -> str:
    """What the command says; what is printed of it, and the exit code, are tested elsewhere."""
    with pytest.raises(errors.RecordingError) as error:
        application()(arguments, standalone_mode=False)
    return str(error.value)


@each("command", ["info", "decode", "plot", "repair"])
def test_a_file_that_is_no_recording_gives_one_line(command: str, wrong: Path) -> None:
    before = wrong.read_bytes() if wrong.is_file() else None
    line = refused("log", command, str(wrong))
    assert str(wrong) in line
    assert ("record again" if before == MAGIC else "name a") in line  # what to do
    assert "\n" not in line
    assert before is None or wrong.read_bytes() == before


def test_a_recording_that_was_compressed_by_others(day: Path, tmp_path: Path) -> None:
    path = rewritten(day, tmp_path / "small.mcap", compression=CompressionType.ZSTD)
    for command in ("decode", "plot"):
        assert "mcap decompress" in refused("log", command, str(path))
    # What its end says needs no record.
    ours, theirs = (json.loads(output("log", "info", str(one), "--json")) for one in (day, path))
    assert theirs == ours | {"file": str(path), "size_bytes": path.stat().st_size}


def test_a_recording_of_another_release(tmp_path: Path) -> None:
    said = {"version": "9.8.7", "schema": "deadbeef"}
    path = write(tmp_path / "future.mcap", [Record(0, Kind.NOTE, 1, b"{}")], said=said)
    assert "9.8.7" in check_error(run("log", "info", str(path)), errors.RecordingError)


def test_a_record_that_means_nothing(tmp_path: Path) -> None:
    path = write(tmp_path / "odd.mcap", [Record(0, Kind.START, 1, b"{}")], said={})
    assert "of this release" in check_error(run("log", "plot", str(path)), errors.RecordingError)


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        (("mock", "day.txt"), errors.InvalidArgument, "ends in .mcap"),
        (("mock", "/nowhere/day.mcap"), errors.RecordingError, "there is no folder"),
        (("old.mcap", "new.mcap"), errors.InvalidArgument, "is a recording already"),
        (("/dev/no-such-port", "day.mcap"), errors.PortUnavailable, "no such port"),
    ],
)
def test_what_cannot_be_recorded(
    arguments: tuple[str, str], error: type[errors.WheelwireError], text: str, tmp_path: Path
) -> None:
    result = captured(*PROGRAM, "log", "record", *arguments, cwd=tmp_path)
    assert text in check_error(result, error)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("results", "asked"),
    [
        ([None], 1),
        ([errors.LinkLost("gone"), errors.RequestTimeout("silent"), None], 3),
        ([errors.GroupUnavailable("sensor", 1, 2)], 1),
    ],
)
def test_a_robot_that_was_not_reached_is_asked_again_for_its_sensors(
    results: list[errors.WheelwireError | None], asked: int
) -> None:
    calls = 0

    def start() -> None:
        nonlocal calls
        calls += 1
        error = results[calls - 1]
        if error is not None:
            raise error

    robot = SimpleNamespace(read=lambda _timeout: None, sensors=SimpleNamespace(start=start))
    log._wait(cast("Any", robot), cast("Any", SimpleNamespace(error=None)), time.monotonic() + 0.5)
    assert calls == asked
