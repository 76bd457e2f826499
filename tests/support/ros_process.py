"""The node as a separate process."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from support.processes import interruptible
from support.ros import TIMEOUT_S, Graph

TESTS = Path(__file__).parents[1]


class RobotNode:
    """The node in a separate process.

    Args:
        graph: The graph to join.
        code: Code to run in place of the executable, with the same arguments.
        namespace: With its slash, such as `/left`; empty for none.
        remappings: From a topic's name to another.
        file: A parameter file.
        home: ROS's own folder, where the node remembers its pose; an empty one if not given.
        parameters: By name, with `__` for a dot; they take precedence over the file.
    """

    def __init__(
        self,
        graph: Graph,
        code: str | None = None,
        namespace: str = "",
        remappings: Sequence[tuple[str, str]] = (),
        file: Path | None = None,
        home: Path | None = None,
        **parameters: Any,
    ) -> None:
        arguments = ["--ros-args"]
        if file is not None:
            arguments += ["--params-file", str(file)]
        for name, value in parameters.items():
            arguments += ["-p", f"{name.replace('__', '.')}:={_yaml(value)}"]
        if namespace:
            arguments += ["-r", f"__ns:={namespace}"]
        for name, other in remappings:
            arguments += ["-r", f"{name}:={other}"]
        self.errors_at_end = ""
        """All that it has written to standard error, once it is closed."""
        self._forgotten = 0
        self._home = tempfile.TemporaryDirectory()
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        added = os.environ.get("PYTHONPATH", "").split(os.pathsep)
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(graph.domain),
            "ROS_HOME": str(home or self._home.name),
            # What a test has added to it may stand in for what is installed.
            "PYTHONPATH": os.pathsep.join([str(TESTS), *filter(None, added), *sys.path]),
        }
        program = ["-c", code] if code else ["-m", "wheelwire_ros.hardware_robot"]
        self.process = subprocess.Popen(
            [sys.executable, *program, *arguments],
            env=environment,
            stderr=self._errors,
            preexec_fn=interruptible,
        )

    def errors(self) -> str:
        """What it has written to standard error since `forget_errors`."""
        return os.pread(self._errors.fileno(), self._size, self._forgotten).decode()

    def forget_errors(self) -> None:
        """Leave what was written so far to `errors_at_end`."""
        self._forgotten = self._size

    @property
    def _size(self) -> int:
        return os.fstat(self._errors.fileno()).st_size

    def end(self, number: signal.Signals) -> int:
        """Send a signal and wait; returns the exit code."""
        self.process.send_signal(number)
        return self.process.wait(TIMEOUT_S)

    def close(self) -> None:
        """Interrupt it, if it still runs."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise
        finally:
            self._forgotten = 0
            self.errors_at_end = self.errors()
            sys.stderr.write(self.errors_at_end)
            self._errors.close()
            self._home.cleanup()

    def __enter__(self) -> RobotNode:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _yaml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return ".nan" if math.isnan(value) else repr(value)
    return str(value)
