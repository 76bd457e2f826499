"""The line to the application: one connected socket, or a listening one."""

from __future__ import annotations

import socket
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path

from wheelwire_protocol.core import Core

READ_SIZE = 4096
SEND_BUFFER = 4608
"""Little more than the smallest that Linux allows, so that states do not grow old in an unread
queue."""


class Line(ABC):
    """Bytes to and from the application, if one is connected. No method blocks."""

    def __init__(self) -> None:
        self.hung_up = False
        """The application has gone, and `next_host` has not been called since."""
        self._host: socket.socket | None = None
        self._output = b""

    def wait_set(self) -> tuple[list[int], list[int]]:
        """The descriptors to wait for: to read, and to write."""
        if self._host is None:
            return [], []
        fd = self._host.fileno()
        return [fd], [fd] if self._output else []

    def receive(self, ready: list[int]) -> bytes:
        """What has arrived; empty if nothing has."""
        if self._host is None or self._host.fileno() not in ready:
            return b""
        data = b""
        try:
            data = self._host.recv(READ_SIZE)
        except BlockingIOError:
            # Nothing has arrived, but this is not the end.
            return b""
        except OSError:
            pass  # an end like any other
        # Nothing to read at a socket that was readable: the host has closed it.
        self.hung_up = not data
        return data

    def send(self, core: Core) -> None:
        """Send the core's output as far as there is room; the rest stays in the core."""
        if self._host is None:
            core.take()  # no application is connected; the core's queue must not fill up
            return
        # First the rest of what was sent in part: no frame may begin inside another.
        self._output = self._output or core.take()
        while self._output:
            try:
                sent = self._host.send(self._output)
            except BlockingIOError:
                return
            except OSError:
                # Not raised: the loop deals with a host that has gone at one place.
                self.hung_up = True
                return
            self._output = self._output[sent:] or core.take()

    @abstractmethod
    def next_host(self) -> bool:
        """Forget the application that has gone; returns whether another one may connect."""

    def close(self) -> None:
        """Disconnect the application."""
        host, self._host = self._host, None
        self._output = b""
        self.hung_up = False
        if host is not None:
            host.close()

    def _adopt_host(self, host: socket.socket) -> None:
        host.setblocking(False)
        host.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self._host = host


class ConnectedLine(Line):
    """One application, which started this process."""

    def __init__(self, fd: int) -> None:
        super().__init__()
        self._adopt_host(socket.socket(fileno=fd))

    def next_host(self) -> bool:
        """Never: the process ends with its application."""
        return False


class ListeningLine(Line):
    """One application at a time; others are disconnected at once.

    Args:
        path: Path of the socket. A stale one, without a listener, is replaced.

    Raises:
        OSError: It cannot be created, or another process listens there.
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

    def wait_set(self) -> tuple[list[int], list[int]]:
        """Also waits for an application to connect."""
        readable, writable = super().wait_set()
        return [*self._listening, *readable], writable

    def receive(self, ready: list[int]) -> bytes:
        """Also accepts a new application."""
        if self._server is not None and self._server.fileno() in ready:
            with suppress(BlockingIOError):
                # The application may have disconnected already: then there is nothing to accept.
                host, _ = self._server.accept()
                if self._host is None:
                    self._adopt_host(host)
                else:
                    host.close()
        return super().receive(ready)

    def next_host(self) -> bool:
        """Another application may connect at any time."""
        # Not this class's own `close`, which would also stop listening.
        super().close()
        return True

    def close(self) -> None:
        """Disconnect the application and remove the socket."""
        super().close()
        server, self._server = self._server, None
        if server is not None:
            server.close()
            with suppress(OSError):
                self._path.unlink()

    @property
    def _listening(self) -> list[int]:
        return [] if self._server is None else [self._server.fileno()]


def _is_abandoned(path: Path) -> bool:
    if not path.is_socket():
        return False
    # A killed process leaves its socket's file behind, and `bind` takes no name that exists.
    with socket.socket(socket.AF_UNIX) as probe:
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            return True
    return False
