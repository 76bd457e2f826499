"""The command `wheelwire` in a process of its own, as a person or a script runs it."""

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
    """Run it to its end."""
    return subprocess.run(
        [*PROGRAM, *arguments],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        check=False,
        env={**os.environ, "COLUMNS": "100", **environment},
    )


def run_json(*arguments: str) -> Any:
    """What it prints with `--json`."""
    result = run(*arguments, "--json")
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def check_error(
    result: subprocess.CompletedProcess[str], error: type[errors.WheelwireError]
) -> str:
    """Its one line on stderr, once it has ended with this error and printed nothing else."""
    assert result.returncode == error.exit_code, result.stderr
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("wheelwire: ")
    return line
