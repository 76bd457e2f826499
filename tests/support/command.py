"""Runs the command `wheelwire` in a separate process, like a user or a script."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

from wheelwire import errors

PROGRAM = [sys.executable, "-m", "wheelwire"]
TIMEOUT_S = 60.0


def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command to its end."""
    return run_within(TIMEOUT_S, *arguments, **environment)


def run_within(
    timeout_s: float, *arguments: str, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run a command that takes its time."""
    return subprocess.run(
        [*PROGRAM, *arguments],
        capture_output=True,
        text=True,
        timeout=timeout_s,
        check=False,
        env={**os.environ, "COLUMNS": "100", **environment},
    )


def output(*arguments: str, **environment: str) -> str:
    """What the command prints; it must succeed."""
    result = run(*arguments, **environment)
    assert result.returncode == 0, result.stderr
    return result.stdout


def run_json(*arguments: str) -> Any:
    """The command's output with `--json`."""
    return json.loads(output(*arguments, "--json"))


def check_error(
    result: subprocess.CompletedProcess[str], error: type[errors.WheelwireError]
) -> str:
    """Check that it failed with this error only; returns its line on stderr."""
    assert result.returncode == error.exit_code, result.stderr
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("wheelwire: ")
    return line
