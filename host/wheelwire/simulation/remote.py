"""The console of a simulator that runs in another process: a socket that is named by the process.

One line is one command of `wheelwire-fwsim`'s console, and its answer is one line of JSON.
"""

from __future__ import annotations

import json
import os
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import WheelwireError
from ..link.sharing_folder import sharing_folder

_PREFIX, _SUFFIX = "sim-", ".sock"
_ANSWER_S = 5.0
_WHICH = "link"
"""The command that asks for the simulator's port."""


class RemoteConsole:
    """Offers a simulator's console to other programs of this user, during a `with` block.

    Args:
        link: Path of its port, which tells it from others.
        command: Does one command, and returns its answer; raises `WheelwireError`.

    Raises:
        ConfigurationError: Others can get into the folder of the sockets.
        OSError: The socket cannot be made.
    """

    def __init__(self, link: str, command: Callable[[str], dict[str, Any]]) -> None:
        self._link = str(Path(link).absolute())
        self._command = command
        self._path = sharing_folder(make=True).path / f"{_PREFIX}{os.getpid()}{_SUFFIX}"
        self._path.unlink(missing_ok=True)  # of a previous process of this number
        self._listener = socket.socket(socket.AF_UNIX)
        try:
            self._listener.bind(str(self._path))
            self._path.chmod(0o600)  # before it listens, so that nobody can connect earlier
            self._listener.listen()
        except OSError:
            self._listener.close()
            raise
        threading.Thread(target=self._accept, name="console", daemon=True).start()

    def __enter__(self) -> RemoteConsole:
        return self

    def __exit__(self, *_: object) -> None:
        self._path.unlink(missing_ok=True)
        # Only a shutdown wakes the thread that accepts.
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        with suppress(OSError), connection, connection.makefile("rw", encoding="utf-8") as lines:
            for line in lines:
                lines.write(json.dumps(self._answer(line.strip())) + "\n")
                lines.flush()

    def _answer(self, line: str) -> dict[str, Any]:
        if line == _WHICH:
            return {"ok": True, "link": self._link}
        try:
            return self._command(line)
        except WheelwireError as error:
            return {"ok": False, "error": str(error)}


class RemoteSimulator:
    """A simulator that runs elsewhere.

    Attributes:
        link: Path of its port.
    """

    def __init__(self, connection: socket.socket) -> None:
        connection.settimeout(_ANSWER_S)
        self._connection = connection
        self._lines = connection.makefile("rw", encoding="utf-8")
        self.link = str(self._ask(_WHICH)["link"])

    def set(self, name: str, value: float) -> None:
        """Set a variable, in its unit; raises `WheelwireError`."""
        self._ask(f"set {name} {float(value)!r}")

    def get(self, name: str) -> float:
        """Read a variable, in its unit; raises `WheelwireError`."""
        return float(self._ask(f"get {name}")["value"])

    def close(self) -> None:
        """End the connection; the simulator goes on."""
        with suppress(OSError):  # what could not be sent stays in its buffer
            self._lines.close()
        self._connection.close()

    def _ask(self, line: str) -> dict[str, Any]:
        try:
            self._lines.write(line + "\n")
            self._lines.flush()
            answer = self._lines.readline()
        except ConnectionError:
            answer = ""
        except OSError as error:
            raise WheelwireError(
                f"the simulator does not answer ({error}): start it again"
            ) from error
        if not answer:
            raise WheelwireError("the simulator has ended: start it again")
        said: dict[str, Any] = json.loads(answer)
        if not said["ok"]:
            raise WheelwireError(str(said["error"]))
        return said


def running_simulators() -> list[RemoteSimulator]:
    """All simulators of this user whose console is offered; to be closed."""
    try:
        paths = sorted(sharing_folder().path.glob(f"{_PREFIX}*{_SUFFIX}"))
    except (OSError, WheelwireError):
        return []
    return [found for path in paths if (found := _at(path)) is not None]


def _at(path: Path) -> RemoteSimulator | None:
    connection = socket.socket(socket.AF_UNIX)
    try:
        connection.settimeout(_ANSWER_S)
        connection.connect(str(path))
        return RemoteSimulator(connection)
    except (OSError, WheelwireError) as error:
        connection.close()
        if isinstance(error, ConnectionRefusedError):
            path.unlink(missing_ok=True)  # of a simulator that was killed
        return None
