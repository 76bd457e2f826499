"""`wheelwire log record`, as a person starts and ends it."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from support.command import PROGRAM, run, run_json
from support.processes import interruptible
from support.simulator_on_line import simulator_on
from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import RecordingError
from wheelwire.log.reader import is_complete, metadata
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.files.board import load_board


def started(*arguments: str) -> subprocess.Popen[str]:
    """A recording that has begun: it says so on standard error."""
    process = subprocess.Popen(
        [*PROGRAM, "log", "record", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=interruptible,
    )
    assert process.stderr is not None
    assert "recording to" in process.stderr.readline()
    return process


def ended(process: subprocess.Popen[str]) -> None:
    """End a recording by Ctrl-C."""
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=20)
    assert process.returncode == 0


def messages(path: Path, name: str) -> list[dict[str, Any]]:
    """The recorded messages of one kind."""
    result = run("log", "decode", str(path), "--message", name, "--json")
    return [json.loads(line) for line in result.stdout.splitlines()]


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_in_order(tmp_path: Path, ending: signal.Signals) -> None:
    path = tmp_path / "day.mcap"
    with Simulator(link=tmp_path / "port") as simulator:
        process = started(simulator.port, str(path))
        time.sleep(0.5)
        process.send_signal(ending)
        said, warned = process.communicate(timeout=20)
    assert (process.returncode, warned) == (0, "")
    assert f"wrote {path}" in said
    assert is_complete(path)
    assert metadata(path)["driver"] == "serial"
    assert run_json("log", "info", str(path))["duration_s"] > 0.4


def test_frames_that_are_lost_while_it_records(tmp_path: Path) -> None:
    with simulator_on("noisy", link=tmp_path / "port") as simulator:
        said = run_json(
            "log", "record", simulator.port, str(tmp_path / "day.mcap"), "--seconds", "2"
        )
    info = run_json("log", "info", str(tmp_path / "day.mcap"))
    assert said["frames_lost"] > 5
    # The first gap may have begun before the recording did.
    assert info["frames_lost"] == pytest.approx(said["frames_lost"], abs=3)


def test_for_a_given_time(tmp_path: Path) -> None:
    result = run("log", "record", "mock", str(tmp_path), "--seconds", "1", "--json")
    assert result.returncode == 0, result.stderr
    said = json.loads(result.stdout)
    ((file, size),) = said["files"].items()
    assert Path(file).parent == tmp_path
    assert Path(file).stat().st_size == size
    assert 1.0 <= said["duration_s"] < 1.5
    assert said["records_lost"] == 0
    info = run_json("log", "info", file)
    assert info["complete"] is True
    assert info["frames_lost"] == said["frames_lost"]  # none, unless this computer stood still
    assert info["frames_received"] > 50


def test_it_goes_on_when_a_lost_link_is_back(tmp_path: Path) -> None:
    path = tmp_path / "day.mcap"
    with Simulator(link=tmp_path / "port") as simulator:
        process = started(simulator.port, str(path))
        time.sleep(0.3)
        simulator.unplug()
        time.sleep(0.7)
        simulator.plug()
        assert process.stderr is not None
        notes = [process.stderr.readline() for _ in range(2)]
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20)
    assert process.returncode == 0
    assert "gone" in notes[0]
    assert "back" in notes[1]
    assert is_complete(path)


def test_a_full_disk_ends_it_with_one_line(tmp_path: Path) -> None:
    """By a limit of the file's size, which is to the program what a full disk is."""
    path = tmp_path / "day.mcap"
    limited = ["bash", "-c", 'trap "" XFSZ; ulimit -f 100; exec "$@"', "-"]
    # -B: Python would leave half of a compiled module, and read it next time.
    program = [sys.executable, "-B", "-m", "wheelwire"]
    result = subprocess.run(
        [*limited, *program, "log", "record", "mock", str(path), "--seconds", "30"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert result.returncode == RecordingError.exit_code
    lines = result.stderr.splitlines()
    assert "has ended: File too large" in lines[-1]
    assert sum("has ended" in line for line in lines) == 1
    assert run_json("log", "repair", str(path))["repaired"] is True
    assert run_json("log", "info", str(path))["complete"] is True


def test_the_recording_has_the_sensors(tmp_path: Path) -> None:
    path = tmp_path / "day.mcap"
    said = run_json("log", "record", "mock", str(path), "--seconds", "1")
    assert list(said["files"]) == [str(path)]
    found = {one["channel"]: one for one in run_json("sensors", str(path))}
    assert list(found) == ["imu", "battery", "bumper.front_left", "bumper.front_right"]
    assert found["imu"]["rate_hz"] == 200
    assert len(messages(path, "Imu")) == pytest.approx(200 * said["duration_s"], abs=50)


@pytest.mark.parametrize("loss", ["reset", "unplug"])
def test_samples_go_on_after_a_loss(tmp_path: Path, loss: str) -> None:
    path = tmp_path / "day.mcap"
    with Simulator(link=tmp_path / "port") as simulator:
        process = started(simulator.port, str(path))
        wait_until(lambda: messages(path, "Inputs"))
        if loss == "reset":
            simulator.reset()
        else:
            simulator.unplug()
            time.sleep(0.7)
            simulator.plug()
        simulator.set("bumper.front_left", 1)
        wait_until(lambda: any(one["triggered"] for one in messages(path, "Inputs")))
        ended(process)
    pressed = [one["triggered"] for one in messages(path, "Inputs")]
    assert pressed[0] == 0
    assert pressed[-1] != 0


def test_a_robot_without_sensors(tmp_path: Path) -> None:
    path = tmp_path / "day.mcap"
    with Simulator(link=tmp_path / "port") as simulator:
        with SerialDriver(simulator.port) as robot:
            robot.board.take_up(load_board("tb6612"))
        result = run("log", "record", simulator.port, str(path), "--seconds", "0.5")
    assert result.returncode == 0, result.stderr
    assert run_json("sensors", str(path)) == []


def test_ctrl_c_at_once(tmp_path: Path) -> None:
    path = tmp_path / "day.mcap"
    ended(started("mock", str(path)))
    assert is_complete(path)
