"""`wheelwire support`: one archive, with what a bug report needs and nothing personal."""

from __future__ import annotations

import json
import platform
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from support.command import check_error, run, run_json
from support.own_board import OWN_BOARD
from wheelwire import errors
from wheelwire.tools import support
from wheelwire.tools.files.board import load_board
from wheelwire.tools.files.parameters import load_parameter_file
from wheelwire_protocol.parameters import PARAMETERS


def test_the_archive_has_what_the_robot_says(tmp_path: Path) -> None:
    target = tmp_path / "report.zip"
    said = run_json("support", "mock", "--output", str(target))
    assert said["file"] == str(target)
    with zipfile.ZipFile(target) as archive:
        assert set(archive.namelist()) == set(said["parts"])
        archive.extractall(tmp_path)
    assert len(load_parameter_file(tmp_path / "parameters.yaml").values) == len(PARAMETERS)
    board = load_board(tmp_path / "board.yaml")
    assert replace(board, peripherals=()) == OWN_BOARD
    assert board.peripherals
    info = json.loads((tmp_path / "info.json").read_text("utf-8"))
    assert info["device"]["board"] == "SIMULATED"
    counted = json.loads((tmp_path / "device.json").read_text("utf-8"))
    assert counted["link"]["frames_received"] > 0
    versions = json.loads((tmp_path / "versions.json").read_text("utf-8"))
    assert versions["python"] == platform.python_version()


def test_a_robot_out_of_reach_is_packed_as_its_error(tmp_path: Path) -> None:
    target = tmp_path / "report.zip"
    result = run("support", "/dev/no-such-port", "--output", str(target))
    assert result.returncode == 0, result.stderr
    with zipfile.ZipFile(target) as archive:
        error = json.loads(archive.read("error.json"))
        assert set(archive.namelist()) == {"versions.json", "error.json"}
    assert error["error"] == "PortUnavailable"
    assert "why the robot is not in it: cannot open /dev/no-such-port" in result.stdout


def test_a_file_that_is_there_stays(tmp_path: Path) -> None:
    target = tmp_path / "report.zip"
    target.write_text("mine")
    result = run("support", "mock", "--output", str(target))
    assert "exists" in check_error(result, errors.OutputFailed)
    assert target.read_text() == "mine"


def test_an_archive_that_cannot_be_finished_is_removed(tmp_path: Path) -> None:
    target = tmp_path / "report.zip"
    missing = tmp_path / "no.mcap"
    result = run("support", "mock", "--output", str(target), "--recording", str(missing))
    assert "no.mcap" in check_error(result, errors.OutputFailed)
    assert not target.exists()


def test_a_folder_is_no_archive() -> None:
    with pytest.raises(errors.OutputFailed, match="name another file"), support._written(Path()):
        pass


def test_names_of_mounted_disks_and_of_the_user_are_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(support, "_mounted", lambda: [Path("/media/ada/Ada L's disk")])
    monkeypatch.setattr(support, "getuser", lambda: "ada")
    said = support._anonymous("cannot open /media/ada/Ada L's disk/day.mcap: no; ada, process 3")
    assert said == "cannot open FOLDER/day.mcap: no; USER, process 3"


def test_a_named_recording_is_packed(tmp_path: Path) -> None:
    recording = tmp_path / "day.mcap"
    recording.write_bytes(bytes(1000))
    target = tmp_path / "report.zip"
    run_json("support", "mock", "--output", str(target), "--recording", str(recording))
    with zipfile.ZipFile(target) as archive:
        assert archive.read("day.mcap") == bytes(1000)


def test_a_folder_above_the_current_one_is_not_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    said = f"{tmp_path.parent}/other/robot.yaml"
    assert support._anonymous(said) == "FOLDER/other/robot.yaml"


@pytest.mark.parametrize(
    ("said", "packed"),
    [
        (
            "cannot open socket://192.168.1.17:3333: refused",
            "cannot open socket://ADDRESS: refused",
        ),
        ("cannot reach 10.0.0.5", "cannot reach ADDRESS"),
        ("/home/ada/robot.yaml: no", "/home/NAME/robot.yaml: no"),
        (f"{Path.cwd()}/robot.yaml", "./robot.yaml"),
        ("/media/ada/ADAS_DISK/day.mcap: no", "/media/NAME/day.mcap: no"),
        ("unix:/run/user/1000/robot.sock", "unix:/run/user/NAME/robot.sock"),
        ("/srv/ada/robots/robot.yaml, line 3: no", "FOLDER/robot.yaml, line 3: no"),
        ("1/s, 2 m/s^2, and/or, https://a.b/c/d", "1/s, 2 m/s^2, and/or, https://a.b/c/d"),
        ("/usr/lib/python3/x.py", "/usr/lib/python3/x.py"),
        ("version 1.2.3", "version 1.2.3"),
        ("/dev/ttyUSB0", "/dev/ttyUSB0"),
    ],
)
def test_no_person_and_no_network_is_named(said: str, packed: str) -> None:
    assert support._anonymous(said) == packed
    assert "ada" not in support._anonymous(said).lower().replace("data", "")
    assert platform.node() not in support._anonymous(f"on {platform.node()}: {said}")
