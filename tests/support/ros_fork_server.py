"""Starts the processes of nodes as copies of one that has imported what a node needs.

Reading its modules takes a node a second of processor time, most of what a short test takes. A copy
is a process like any other: it has its own arguments, environment and files, it takes signals, and
it ends as a new interpreter does.

`-m support.ros_fork_server`: the server, on a socket as standard input, as `ForkServer` starts it.
"""

from __future__ import annotations

import atexit
import ctypes
import json
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from typing import Any

from support.forking import fork
from support.processes import interruptible

TESTS = Path(__file__).parents[1]
MESSAGE_BYTES = 100_000
SIGNAL_SET_BYTES = 128
RUN = "from wheelwire_ros.hardware_robot import main; main()"
"""The node's executable, for a copy."""


class ForkedProcess:
    """A copy; what the tests use of `subprocess.Popen`."""

    def __init__(self, server: ForkServer, pid: int) -> None:
        self._server = server
        self.pid = pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """The exit code, or minus the signal's number, once it has ended."""
        if self.returncode is None:
            self.returncode = self._server.ask({"poll": self.pid})
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """The same, waiting for the end; raises `subprocess.TimeoutExpired`."""
        if self.poll() is None:
            end = os.pidfd_open(self.pid)
            try:
                select.select([end], [], [], timeout)
            finally:
                os.close(end)
            if self.poll() is None:
                raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
        assert self.returncode is not None
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """At once."""
        self.send_signal(signal.SIGKILL)


class ForkServer:
    """The process that the copies are made of."""

    def __init__(self) -> None:
        self._line, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with there:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "support.ros_fork_server"],
                stdin=there.fileno(),
                env={**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), *sys.path])},
                preexec_fn=interruptible,
            )

    def start(
        self, code: str, arguments: Sequence[str], environment: dict[str, str], errors: int
    ) -> ForkedProcess:
        """Run code in a copy; standard error goes to the descriptor `errors`."""
        request = {"code": code, "arguments": arguments, "environment": environment}
        socket.send_fds(self._line, [json.dumps(request).encode()], [1, errors])
        return ForkedProcess(self, self._answer())

    def ask(self, request: dict[str, Any]) -> Any:
        """The server's answer."""
        self._line.send(json.dumps(request).encode())
        return self._answer()

    def _answer(self) -> Any:
        answer = self._line.recv(MESSAGE_BYTES)
        assert answer, "the fork server has ended"
        return json.loads(answer)

    def close(self) -> None:
        """End it, and the copies that still run."""
        self._line.close()
        self._process.wait()


@cache
def fork_server() -> ForkServer:
    """This process's, which ends with it."""
    server = ForkServer()
    atexit.register(server.close)
    return server


def _serve(line: socket.socket) -> dict[str, Any] | None:
    """Serve this process's requests; returns the request in a copy, and None at the end."""
    running: set[int] = set()
    while True:
        message, descriptors, _, _ = socket.recv_fds(line, MESSAGE_BYTES, 2)
        if not message:
            break
        request: dict[str, Any] = json.loads(message)
        if "poll" in request:
            pid, status = os.waitpid(request["poll"], os.WNOHANG)
            running.discard(pid)
            answer = os.waitstatus_to_exitcode(status) if pid else None
        else:
            answer = fork()
            if answer == 0:
                _become(request, descriptors)
                return request
            running.add(answer)
            for descriptor in descriptors:
                os.close(descriptor)
        line.send(json.dumps(answer).encode())
    for pid in running:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    return None


def _become(request: dict[str, Any], descriptors: Sequence[int]) -> None:
    """Make this process, a copy, one that was started with the arguments of the request."""
    for descriptor, number in zip(descriptors, (1, 2), strict=True):
        os.dup2(descriptor, number)
        os.close(descriptor)
    with Path(os.devnull).open() as nothing:
        os.dup2(nothing.fileno(), 0)
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.argv[:] = ["-c", *request["arguments"]]
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])


def _import() -> None:
    """What a node imports, also when it creates its first topics and services."""
    import wheelwire_ros.hardware_robot  # noqa: F401 - not in the tests' process

    for name, module in tuple(sys.modules.items()):
        if ".msg._" in name or ".srv._" in name:
            for one in vars(module).values():
                load = getattr(type(one), "__import_type_support__", None)
                if load is not None:
                    load()


def _tell_lttng_of_forks() -> None:
    """ROS's tracing has threads, which a copy has to start again: it ends them at its own end."""
    words = Path("/proc/self/maps").read_text().split()
    for library in {word for word in words if "liblttng-ust" in word}:
        ust, signals = ctypes.CDLL(library), ctypes.create_string_buffer(SIGNAL_SET_BYTES)
        for prefix in ("ust", "lttng_ust"):  # of release 2.12, and of later ones
            if hasattr(ust, f"{prefix}_before_fork"):
                os.register_at_fork(
                    before=partial(ust[f"{prefix}_before_fork"], signals),
                    after_in_parent=partial(ust[f"{prefix}_after_fork_parent"], signals),
                    after_in_child=partial(ust[f"{prefix}_after_fork_child"], signals),
                )


def main() -> None:
    """Serve; a copy leaves the loop, and runs its code."""
    # A person's, who interrupts the tests; a copy takes it once it is ready.
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    _import()
    _tell_lttng_of_forks()
    line = socket.socket(fileno=os.dup(0))
    with line:
        request = _serve(line)
    if request is not None:
        exec(request["code"], {"__name__": "__main__"})  # noqa: S102 - a test's


if __name__ == "__main__":
    main()
