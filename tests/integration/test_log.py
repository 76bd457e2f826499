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
from support.waiting import wait_until
from wheelwire.errors import RecordingError
from wheelwire.log.reader import is_complete, metadata
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


def test_a_recording_goes_on_after_a_reset_and_a_lost_link(tmp_path: Path) -> None:
    path = tmp_path / "day.mcap"
    with Simulator(link=tmp_path / "port") as simulator:
        process = started(simulator.port, str(path))
        wait_until(lambda: messages(path, "Inputs"))
        simulator.reset()
        simulator.unplug()
        time.sleep(0.7)
        simulator.plug()
        notes = process.stderr
        assert notes is not None
        wait_until(lambda: "back" in notes.readline())
        simulator.set("bumper.front_left", 1)
        wait_until(lambda: any(one["triggered"] for one in messages(path, "Inputs")))
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20)
    assert process.returncode == 0
    assert is_complete(path)
    pressed = [one["triggered"] for one in messages(path, "Inputs")]
    assert pressed[0] == 0
    assert pressed[-1] != 0
