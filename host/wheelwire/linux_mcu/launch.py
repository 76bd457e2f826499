"""Starting the process that moves this computer's pins, and being its application."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from .. import errors
from ..link.transports import SocketTransport
from .settings import McuSettings

START_S = 20.0
"""A Raspberry Pi needs a second or two, and a former process up to 6 s to let its pins go."""
END_S = 7.0
"""It brakes for 5 s at most before it ends."""
KILL_S = 1.0


class ChildTransport(SocketTransport):
    """A process of ours at the other end of a socket; it ends with the transport.

    Args:
        connection: Our end.
        process: At the other end.
    """

    gone = "the process that moves the pins has ended; it is started again"
    longest_pause_s = 1.0

    def __init__(self, connection: socket.socket, process: subprocess.Popen[bytes]) -> None:
        super().__init__(connection)
        self._process = process

    def close(self) -> None:
        """Hang up, and wait until the process has stopped the wheels and let its pins go."""
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)  # a fork may hold a copy of it
        super().close()
        end(self._process)


class McuTransport(ChildTransport):
    """To the process that moves this computer's pins.

    Attributes:
        limits: What its wiring cannot do, in sentences.
    """

    limits: tuple[str, ...] = ()


def launch(settings: McuSettings) -> McuTransport:
    """Start the process and wait until it has its pins.

    Raises:
        DriverUnavailable: It cannot have them, or ended; with what it says.
        ConfigurationError: The settings do not fit.
    """
    ours, theirs = socket.socketpair()
    with theirs:
        told = replace(settings, socket=theirs.fileno(), parent=os.getpid())
        process = start(
            [sys.executable, "-m", "wheelwire.linux_mcu", told.to_json()], theirs.fileno()
        )
    transport = McuTransport(ours, process)
    try:
        answer = _checked(_first_line(ours, process))
    except BaseException:
        transport.close()
        raise
    transport.port = settings.backend
    transport.limits = tuple(answer["limits"])
    return transport


def start(command: Sequence[str], fd: int) -> subprocess.Popen[bytes]:
    """A process that inherits one descriptor; a Ctrl-C at the terminal does not reach it."""
    return subprocess.Popen(
        command,
        pass_fds=[fd],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )


def end(process: subprocess.Popen[bytes]) -> None:
    """Wait for the end of a process that was hung up on; make it end when it does not."""
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(KILL_S)
        process.kill()
        process.wait()


def _first_line(connection: socket.socket, process: subprocess.Popen[bytes]) -> dict[str, Any]:
    """How the start went. Nothing comes after it before we speak."""
    line, until = b"", time.monotonic() + START_S
    while not line.endswith(b"\n"):
        connection.settimeout(max(0.001, until - time.monotonic()))
        try:
            data = connection.recv(4096)
        except TimeoutError:
            raise errors.DriverUnavailable(
                f"the process that moves the pins did not start within {START_S:g} s"
            ) from None
        except ConnectionError:
            data = b""
        if not data:
            end(process)
            raise errors.DriverUnavailable(
                "the process that moves the pins ended at its start, with status "
                f"{process.returncode}: its own message is on standard error"
            )
        line += data
    connection.setblocking(False)
    answer: dict[str, Any] = json.loads(line)
    return answer


def _checked(answer: dict[str, Any]) -> dict[str, Any]:
    if "error" not in answer:
        return answer
    kinds = (errors.DriverUnavailable, errors.ConfigurationError)
    kind = next((k for k in kinds if k.__name__ == answer["error"]), errors.DriverUnavailable)
    raise kind(answer["text"])
