"""Runs the command `wheelwire`: in this process, or in one of its own as a user does."""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys
from typing import Any
from unittest import mock

from wheelwire import errors
from wheelwire.cli import app
from wheelwire.cli import output as output_module

from .processes import captured

PROGRAM = [sys.executable, "-m", "wheelwire"]
TIMEOUT_S = 60.0

Result = subprocess.CompletedProcess[str]


def run(*arguments: str, typed: str = "", **environment: str) -> Result:
    """Run the command to its end in this process, which saves the start of an interpreter.

    It reads what is `typed`, then the end of a file.

    What needs a process runs by `run_process`: signals, a link that this process itself holds,
    streams that are no files in memory.
    """
    columns = int(environment.setdefault("COLUMNS", "100"))
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8", write_through=True) for _ in range(2))
    with (
        mock.patch.dict(os.environ, environment),
        mock.patch.object(output_module.console, "_width", columns),
        mock.patch.object(output_module.error_console, "_width", columns),
        mock.patch.object(sys, "argv", ["wheelwire", *arguments]),
        mock.patch.object(sys, "stdin", io.TextIOWrapper(io.BytesIO(typed.encode()))),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            code: Any = app.run()
        except SystemExit as ended:
            code = ended.code or 0
    texts = [stream.buffer.getvalue().decode() for stream in (out, err)]
    return subprocess.CompletedProcess(arguments, code, *texts)


def run_process(*arguments: str, timeout_s: float = TIMEOUT_S, **environment: str) -> Result:
    """Run the command to its end in a process of its own."""
    environment = {**os.environ, "COLUMNS": "100", **environment}
    return captured(*PROGRAM, *arguments, timeout=timeout_s, env=environment)


def output(*arguments: str, **environment: str) -> str:
    """What the command prints; it must succeed."""
    result = run(*arguments, **environment)
    assert result.returncode == 0, result.stderr
    return result.stdout


def run_json(*arguments: str) -> Any:
    """The command's output with `--json`."""
    return json.loads(output(*arguments, "--json"))


def check_error(result: Result, error: type[errors.WheelwireError]) -> str:
    """Check that it failed with this error only; returns its line on stderr."""
    assert result.returncode == error.exit_code, result.stderr
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("wheelwire: ")
    return line
