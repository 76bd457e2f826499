"""Starting the process that moves this computer's pins, and the transport to it."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from .. import errors
from ..link.transports import SocketTransport
from .settings import McuSettings

START_TIMEOUT_S = 20.0
"""A Raspberry Pi needs a second or two, and a previous process up to 6 s to release its pins."""
EXIT_TIMEOUT_S = 7.0
"""A process that ends brakes for at most 5 s before."""
TERMINATE_TIMEOUT_S = 1.0


class McuTransport(SocketTransport):
    """A socket to the process that moves this computer's pins, which ends with the transport.

    Args:
        connection: This end of the socket.
        process: The child at the other end.

    Attributes:
        limits: What this wiring cannot do, in sentences.
    """

    gone = "the process that moves the pins has ended; it is being restarted"
    # Longer than for a port: each attempt starts a process.
    longest_pause_s = 1.0
    limits: tuple[str, ...] = ()

    def __init__(self, connection: socket.socket, process: subprocess.Popen[bytes]) -> None:
        super().__init__(connection)
        self._process = process

    def close(self) -> None:
        """Disconnect, and wait until the process has stopped the wheels and released its pins."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)  # closes it even if a fork holds a copy
        super().close()
        end(self._process)


def launch(settings: McuSettings) -> McuTransport:
    """Start the process and wait until it has claimed its pins.

    Raises:
        DriverUnavailable: It could not claim them, or ended. The message has its reason.
        ConfigurationError: The settings are invalid.
    """
    ours, theirs = socket.socketpair()
    with theirs:  # with a copy here, the end of the child would not close the connection
        child_settings = replace(settings, socket=theirs.fileno(), parent=os.getpid())
        process = start(
            [sys.executable, "-m", "wheelwire.pi", child_settings.to_json()], theirs.fileno()
        )
    transport = McuTransport(ours, process)
    try:
        answer = _raise_error_of(_first_line(ours, process))
    except BaseException:
        # Ctrl-C, for one: the process must not be left behind with the pins.
        transport.close()
        raise
    transport.port = settings.backend
    transport.limits = tuple(answer["limits"])
    return transport


def start(command: Sequence[str], fd: int) -> subprocess.Popen[bytes]:
    """Start a process that inherits one descriptor and gets no Ctrl-C from the terminal."""
    # stderr stays the application's: a process that fails without an answer says why there.
    return subprocess.Popen(
        command,
        pass_fds=[fd],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )


def end(process: subprocess.Popen[bytes]) -> None:
    """Wait until a disconnected process ends; terminate it, then kill it, if it does not."""
    try:
        process.wait(EXIT_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(TERMINATE_TIMEOUT_S)
        # This is the guard, whose end the core notices: it then stops the wheels and ends, too.
        process.kill()
        process.wait()


def _first_line(connection: socket.socket, process: subprocess.Popen[bytes]) -> dict[str, Any]:
    """The result of the start. The process sends nothing else until it is spoken to."""
    connection.settimeout(START_TIMEOUT_S)
    try:
        with connection.makefile("rb") as lines:
            line = lines.readline()
    except TimeoutError:
        raise errors.DriverUnavailable(
            f"the process that moves the pins did not start within {START_TIMEOUT_S:g} s: "
            "its message, if any, is on standard error"
        ) from None
    except ConnectionError:
        line = b""  # a connection that is reset is an end like any other
    if not line.endswith(b"\n"):
        # It waits: only after that is the status known.
        end(process)
        raise errors.DriverUnavailable(
            "the process that moves the pins ended at its start with status "
            f"{process.returncode}: its message is on standard error"
        )
    # As `SocketTransport` had made it, before the time-outs above.
    connection.setblocking(False)
    answer: dict[str, Any] = json.loads(line)
    return answer


def _raise_error_of(answer: dict[str, Any]) -> dict[str, Any]:
    if "error" not in answer:
        return answer
    kinds = (errors.DriverUnavailable, errors.ConfigurationError)
    # Anything else, such as a missing library, means that the driver is not available.
    kind = next((k for k in kinds if k.__name__ == answer["error"]), errors.DriverUnavailable)
    raise kind(answer["text"])
