"""`wheelwire log record`, as a person starts and ends it."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from pathlib import Path

import pytest

from support.command import PROGRAM, run, run_json
from support.processes import interruptible
from support.simulator_on_line import simulator_on
from wheelwire.errors import RecordingError
from wheelwire.recording.reader import is_complete, metadata
from wheelwire.simulation.simulator import Simulator


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
    limited = ["bash", "-c", 'trap "" XFSZ; ulimit -f 100; exec "$@"', "-", *PROGRAM]
    result = subprocess.run(
        [*limited, "log", "record", "mock", str(path), "--seconds", "30"],
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
