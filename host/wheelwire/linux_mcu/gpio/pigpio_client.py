"""A connection to pigpiod that notices its end.

pigpio's client (1.78, its last) waits for ever for an answer that does not come, and its callback
thread spins when the daemon closes the connection. Both are mended here, from outside.
"""

from __future__ import annotations

import atexit
import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from ...errors import DriverUnavailable, LinkLost

CONNECT_TIMEOUT_S = 3.0
ANSWER_TIMEOUT_S = 0.5
"""The daemon answers within a millisecond, a wireless network within some tens."""
JOIN_S = 0.5


class PigpioClient:
    """An open connection.

    Args:
        host: Where the daemon runs.
        port: Its TCP port.

    Raises:
        DriverUnavailable: The library is not installed, or no daemon answers.
    """

    def __init__(self, host: str, port: int) -> None:
        try:
            import pigpio
        except ImportError as error:
            raise DriverUnavailable(
                "driver 'pigpio' needs pigpio's client: pip install 'wheelwire[pi]'"
            ) from error
        self.library = pigpio
        self.address = f"{host}:{port}"
        _probe(host, port, self.address)
        with _ending_threads(pigpio):
            self._pi = pigpio.pi(host, port, show_errors=False)
        if not self._pi.connected:
            raise DriverUnavailable(f"what answers at {self.address} is no pigpiod")
        # Its exit handler would cut the connection before the driver's stops the wheels.
        atexit.unregister(self._pi.stop)
        self._pi.sl.s.settimeout(ANSWER_TIMEOUT_S)
        self._closed = False
        self._notify = self._pi._notify
        self._notify_socket: _EndingSocket = self._notify.sl.s

    def call(self, method: str, *arguments: object) -> Any:
        """The result of a method of `pigpio.pi`.

        Raises:
            LinkLost: No answer, or no connection any more; it cannot be used again.
            pigpio.error: The daemon refuses.
        """
        self.check()
        try:
            return getattr(self._pi, method)(*arguments)
        except (OSError, struct.error) as error:  # the latter of an answer cut short
            raise LinkLost(f"pigpiod at {self.address} does not answer: {error}") from error

    def check(self) -> None:
        """Raise `LinkLost` when the daemon has closed the connection."""
        if self._closed or not self._notify.is_alive():
            raise LinkLost(f"pigpiod at {self.address} has closed the connection")

    def close(self) -> None:
        """Close both connections and end the callback thread."""
        self._closed = True
        with suppress(OSError):
            self._pi.stop()
        self._notify.join(JOIN_S)  # a daemon that still runs acknowledges the close
        self._notify_socket.shutdown()
        self._notify.join(JOIN_S)
        self._notify_socket.close()


@contextmanager
def _ending_threads(library: Any) -> Iterator[None]:
    """Callback threads that are made meanwhile end with their connection."""
    thread_class = library._callback_thread

    class EndingThread(thread_class):  # type: ignore[misc, valid-type] # pigpio has no types
        def start(self) -> None:  # the library calls it once the socket is there
            self.sl.s = _EndingSocket(self)
            super().start()

    library._callback_thread = EndingThread
    try:
        yield
    finally:
        library._callback_thread = thread_class


class _EndingSocket:
    """In the place of the callback thread's socket: its end ends the thread."""

    def __init__(self, thread: Any) -> None:
        self._socket: socket.socket = thread.sl.s
        self._thread = thread

    def recv(self, size: int) -> bytes:
        try:
            data = self._socket.recv(size)
        except OSError:
            data = b""
        if not data:
            self._thread.go = False
        return data

    def send(self, data: bytes) -> None:
        with suppress(OSError):
            self._socket.send(data)

    def close(self) -> None:
        self._socket.close()

    def shutdown(self) -> None:
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)


def _probe(host: str, port: int, address: str) -> None:
    """The library's own attempt has no time-out, and tells no reason."""
    try:
        socket.create_connection((host, port), CONNECT_TIMEOUT_S).close()
    except OSError as error:
        raise DriverUnavailable(
            f"no pigpiod at {address} ({error}): start it with `sudo systemctl start pigpiod`, "
            "or give host and port"
        ) from error
