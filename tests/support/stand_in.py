"""A stand-in for hardware as a separate process, controlled by lines of text."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

PRIORITY = 30
"""Below the priority of the process that moves the pins."""
TESTS = Path(__file__).parents[1]
Self = TypeVar("Self", bound="StandIn")


class StandIn:
    """Runs `python -m MODULE` from its construction to `close` or the end of its `with` block."""

    def __init__(self, module: str, *arguments: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), *sys.path])},
        )
        self.first_answer = self._answer()

    def command(self, line: str) -> dict[str, Any]:
        assert self._process.stdin
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        return self._answer()

    def truth(self) -> dict[str, Any]:
        """The true state at this moment."""
        return self.command("truth")

    def set_realtime(self, yes: bool = True) -> None:
        """Give it real-time priority: its own delays would look like the driver's.

        Threads that it starts later inherit the priority.
        """
        policy, priority = (os.SCHED_FIFO, PRIORITY) if yes else (os.SCHED_OTHER, 0)
        with suppress(PermissionError):
            for thread in Path(f"/proc/{self.pid}/task").iterdir():
                os.sched_setscheduler(int(thread.name), policy, os.sched_param(priority))

    @property
    def pid(self) -> int:
        return self._process.pid

    def kill(self) -> None:
        """Kill it, like the out-of-memory killer."""
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout
        line = self._process.stdout.readline()
        assert line, "the stand-in has ended"
        answer: dict[str, Any] = json.loads(line)
        return answer
