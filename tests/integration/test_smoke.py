"""Each command and each driver once, as a process of its own; their rules are tested elsewhere."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from support.command import PROGRAM, TIMEOUT_S, run_process
from support.processes import talking
from wheelwire import errors
from wheelwire.simulation.simulator import Simulator

pytestmark = pytest.mark.fast

ENDS = {
    "ports": 0,
    "info ROBOT": 0,
    "doctor ROBOT": 0,
    "drive ROBOT --linear 0.1 --seconds 0.2": 0,
    "monitor ROBOT --seconds 0.2": 0,
    "sensors ROBOT --seconds 0.2": 0,
    "stop ROBOT": 0,
    "estop ROBOT": 0,
    "clear ROBOT": 0,
    "restart ROBOT": 0,
    "params list ROBOT": 0,
    "params export ROBOT": 0,
    "board list": 0,
    "board read ROBOT": 0,
    "log record ROBOT FILE --seconds 0.5": 0,
    "log info FILE": 0,
    "why FILE": 0,
    "support ROBOT --output ARCHIVE": 0,
    "help safety": 0,
    "demo --output TAKEN": errors.OutputFailed.exit_code,
    "setup": errors.InvalidArgument.exit_code,
    "start": errors.InvalidArgument.exit_code,
    "tune ROBOT --distance 0": errors.InvalidArgument.exit_code,
    "teleop ROBOT": errors.InvalidArgument.exit_code,
    "flash ROBOT --image NONE": errors.FlashFailed.exit_code,
    "mcu --config NONE --listen NONE": errors.ConfigurationError.exit_code,
    "sim --plant NONE": errors.ConfigurationError.exit_code,
}
"""The commands, and how each ends."""


def test_each_command_starts_and_ends(
    simulator: Simulator, tmp_path: Path, subtests: pytest.Subtests
) -> None:
    taken = tmp_path / "taken"
    taken.touch()
    words = {
        "ROBOT": simulator.port,
        "FILE": str(tmp_path / "day.mcap"),
        "ARCHIVE": str(tmp_path / "support.zip"),
        "NONE": str(tmp_path / "none"),
        "TAKEN": str(taken),
    }
    for line, code in ENDS.items():
        with subtests.test(line):
            result = run_process(*(words.get(word, word) for word in line.split()))
            assert "Traceback" not in result.stderr
            assert result.returncode == code, result.stdout + result.stderr
            assert (result.stdout if code == 0 else result.stderr) != ""


def test_a_simulator_runs_until_it_is_interrupted() -> None:
    with talking(*PROGRAM, "sim") as (process, line):
        assert line != ""
        process.send_signal(signal.SIGINT)
        assert process.wait(TIMEOUT_S) in (0, 130)
