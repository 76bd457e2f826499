"""The application's end of the process: one connected socket, or a listening one."""

from __future__ import annotations

import socket
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path

from wheelwire_protocol.native import Core

READ_SIZE = 4096
SEND_BUFFER = 4608
"""The least that Linux gives: what an application does not read shall not grow old in a queue."""


class Line(ABC):
    """Bytes to and from the application, if there is one. Nothing here blocks."""

    def __init__(self) -> None:
        self.received = b""
        """In the last turn."""
        self.hung_up = False
        """The application is gone, and `next_host` was not called yet."""
        self._host: socket.socket | None = None
        self._output = b""

    def awaited(self) -> tuple[list[int], list[int]]:
        """The descriptors whose reading and writing make a turn."""
        if self._host is None:
            return [], []
        fd = self._host.fileno()
        return [fd], [fd] if self._output else []

    def take_turn(self, ready: list[int]) -> bool:
        """Read what is there; True when that was something."""
        self.received = b""
        if self._host is not None and self._host.fileno() in ready:
            self._receive(self._host)
        return bool(self.received)

    def send(self, core: Core) -> None:
        """Hand on what the core says, as far as there is room: the rest waits in the core."""
        if self._host is None:
            core.take()
            return
        self._output = self._output or core.take()
        while self._output:
            try:
                sent = self._host.send(self._output)
            except BlockingIOError:
                return
            except OSError:
                self.hung_up = True
                return
            self._output = self._output[sent:] or core.take()

    @abstractmethod
    def next_host(self) -> bool:
        """Forget the one that is gone; False when there will be no other."""

    def close(self) -> None:
        """Let the application go."""
        host, self._host = self._host, None
        self._output = b""
        self.hung_up = False
        if host is not None:
            host.close()

    def _receive(self, host: socket.socket) -> None:
        try:
            self.received = host.recv(READ_SIZE)
        except BlockingIOError:
            return
        except OSError:
            self.received = b""
        self.hung_up = not self.received

    def _take_host(self, host: socket.socket) -> None:
        host.setblocking(False)
        host.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self._host = host


class ConnectedLine(Line):
    """One application, which started this process."""

    def __init__(self, fd: int) -> None:
        super().__init__()
        self._take_host(socket.socket(fileno=fd))

    def next_host(self) -> bool:
        """There is none."""
        return False


class ListeningLine(Line):
    """One application after the other. Who comes while one is there is sent away.

    Args:
        path: Of the socket; one that nobody listens at any more is replaced.

    Raises:
        OSError: It cannot be made, or somebody listens there.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        if _is_abandoned(path):
            path.unlink()
        self._server: socket.socket | None = socket.socket(socket.AF_UNIX)
        self._server.bind(str(path))
        self._server.listen()
        self._server.setblocking(False)

    def awaited(self) -> tuple[list[int], list[int]]:
        """With the socket where the next application connects."""
        readable, writable = super().awaited()
        return [*self._listening, *readable], writable

    def take_turn(self, ready: list[int]) -> bool:
        """Also let an application in."""
        if self._server is not None and self._server.fileno() in ready:
            self._accept(self._server)
        return super().take_turn(ready)

    def next_host(self) -> bool:
        """There may be one at any time."""
        super().close()
        return True

    def close(self) -> None:
        """No application comes any more."""
        super().close()
        server, self._server = self._server, None
        if server is not None:
            server.close()
            with suppress(OSError):
                self._path.unlink()

    @property
    def _listening(self) -> list[int]:
        return [] if self._server is None else [self._server.fileno()]

    def _accept(self, server: socket.socket) -> None:
        with suppress(BlockingIOError):
            host, _ = server.accept()
            if self._host is None:
                self._take_host(host)
            else:
                host.close()


def _is_abandoned(path: Path) -> bool:
    if not path.is_socket():
        return False
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            return True
    return False
