"""What is not in a recording is not judged: cut, filtered or rewritten by others, still growing."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.cases import each
from support.command import check_error, output, run, run_json
from support.full_disk import no_space
from support.recordings import SAID, rewritten, write
from support.staged_stops import StagedRobot
from support.tapped_line import TappedLine
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.link.traffic import Kind, Record
from wheelwire.log.reader import SENT, SESSION, records
from wheelwire.log.recorder import Recorder, RecordingFile
from wheelwire_protocol.types import ClearEstop

CUT = "host_killed or recording_cut"


@pytest.fixture(scope="module")
def drive() -> list[Record]:
    """A robot that drives at the end, and was e-stopped before."""
    robot = StagedRobot()
    robot.open()
    robot.estop()
    robot.run(0.3)
    robot.request(ClearEstop(0, 0))
    robot.drive(0.0, 0.0, 0.04)
    robot.drive(0.2, 0.2, 0.5)
    return robot.reader.take()


def causes(path: Path) -> list[str]:
    return [stop["cause"] for stop in run_json("why", str(path))]


def test_what_others_wrote_without_chunks_is_the_same_recording(
    drive: list[Record], tmp_path: Path
) -> None:
    day = write(tmp_path / "day.mcap", drive)
    flat = rewritten(day, tmp_path / "flat.mcap", chunked=False)
    assert list(records(flat)) == list(records(day)) == drive
    assert causes(flat) == causes(day) == ["estop_by_session"]
    assert output("log", "decode", str(flat)) == output("log", "decode", str(day))
    data = bytearray(flat.read_bytes())
    at = data.index(SESSION.encode())
    data[at - 4 : at] = b"\xff" * 4  # the length of a channel's topic
    flat.write_bytes(data)
    check_error(run("why", str(flat)), errors.RecordingError)


@each("command", ["why", "log info", "log decode", "log plot", "monitor --plain"])
@pytest.mark.parametrize("topics", [(), (SENT,), (SESSION, SENT)], ids=len)
def test_a_recording_without_its_input_says_so(
    command: str, topics: tuple[str, ...], drive: list[Record], tmp_path: Path
) -> None:
    day = write(tmp_path / f"{command}.mcap", drive)
    path = rewritten(day, tmp_path / f"{command} of odom.mcap", topics)
    words = command.split()
    result = run(*words[:2], str(path), *words[2:])
    if command == "log decode" and topics:
        assert "SetWheelVelocity" in result.stdout  # what there is
        return
    assert result.returncode == errors.RecordingError.exit_code, result.stdout
    assert result.stderr.startswith("wheelwire: ")
    assert "it lacks data of the link" in result.stderr or command.startswith("monitor")


def test_a_robot_that_was_out_of_reach_all_the_time(tmp_path: Path) -> None:
    robot = StagedRobot()
    robot.session.connect(0)
    robot.cable = False
    robot.run(1.0)
    path = write(tmp_path / "day.mcap", robot.reader.take())
    assert "out of reach all the time" in check_error(run("why", str(path)), errors.RecordingError)
    assert run_json("log", "info", str(path))["frames_received"] == 0


def test_a_file_that_is_cut_was_not_always_cut_by_the_program(
    drive: list[Record], tmp_path: Path
) -> None:
    path = write(tmp_path / "day.mcap", drive, ends=False)
    assert causes(path) == ["estop_by_session", CUT]
    assert run_json("log", "repair", str(path))["repaired"]
    assert causes(path) == ["estop_by_session", CUT]


def test_a_recording_closed_before_it_was_cut_does_not_count_as_killed(
    drive: list[Record], tmp_path: Path
) -> None:
    last = drive[-1]
    closed = Record(
        last.number + 1, Kind.DISCONNECTED, last.host_us, b"the link is closed; open it again"
    )
    path = write(tmp_path / "day.mcap", [*drive, closed], ends=False)
    assert causes(path) == ["estop_by_session", "host_hung_up"]


def test_a_recording_that_grows_is_not_over(drive: list[Record], tmp_path: Path) -> None:
    file = RecordingFile(tmp_path / "day.mcap", 0, SAID)
    for record in drive:
        file.add(record)
    file.sync()
    try:
        assert causes(file.path) == ["estop_by_session"]
        assert "It is being recorded" in output("why", str(file.path))
    finally:
        file.close()


def test_a_full_disk_is_no_kill(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    link = TappedLine()
    recorder = Recorder(link, tmp_path / "day.mcap", SAID)
    file = recorder.file
    link.drive(1.0)
    wait_until(lambda: len(list(records(file))) > 50)
    with monkeypatch.context() as patch:
        patch.setattr("wheelwire.log.recorder.os.write", no_space)
        link.drive(1.0)
        wait_until(lambda: recorder.error)
        recorder.close()
    assert causes(file) == []
    text = "gave up before the robot was closed (No space left on device)"
    assert text in " ".join(output("why", str(file)).split())
    info = run_json("log", "info", str(file))
    assert (info["complete"], info["ended_by"]) == (False, "No space left on device")
    assert "No space left on device" in output("log", "info", str(file))
    assert run_json("log", "repair", str(file))["repaired"]
    assert causes(file) == []
