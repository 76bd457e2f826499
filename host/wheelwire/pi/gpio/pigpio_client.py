"""A connection to pigpiod that notices when it is lost.

pigpio's client (1.78, its last) waits forever for an answer that does not come, and its callback
thread spins when the daemon closes the connection. Both are worked around here, from outside.
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
"""The daemon answers within a millisecond, over a wireless network within some tens."""
JOIN_S = 0.5


class PigpioClient:
    """An open connection to a daemon.

    Args:
        host: The daemon's computer.
        port: Its TCP port.

    Raises:
        DriverUnavailable: The library is not installed, or no daemon answers.
    """

    def __init__(self, host: str, port: int) -> None:
        try:
            import pigpio
        except ImportError as error:
            raise DriverUnavailable(
                "driver 'pigpio' moves this computer's own pins and needs pigpio's client: run "
                "pip install 'wheelwire[pi]'. With an ESP32 write driver_type: serial"
            ) from error
        self.library = pigpio
        self.address = f"{host}:{port}"
        _probe(host, port, self.address)
        with _threads_that_end(pigpio):
            self._pi = pigpio.pi(host, port, show_errors=False)
        if not self._pi.connected:
            raise DriverUnavailable(
                f"the program at {self.address} is not pigpiod: give another host or port"
            )
        # pigpio's exit handler would close the connection before ours has stopped the wheels.
        atexit.unregister(self._pi.stop)
        self._pi.sl.s.settimeout(ANSWER_TIMEOUT_S)
        self._closed = False
        # Kept, because the client's `stop` forgets the thread that `close` has to join.
        self._notify = self._pi._notify
        self._notify_socket: _EndingSocket = self._notify.sl.s

    def call(self, method: str, *arguments: object) -> Any:
        """Call a method of `pigpio.pi` and return its result.

        Raises:
            LinkLost: No answer, or the connection is closed. This client cannot be used again.
            pigpio.error: The daemon refused the call.
        """
        self.check()
        try:
            return getattr(self._pi, method)(*arguments)
        except (OSError, struct.error) as error:  # struct.error: a truncated answer
            raise LinkLost(
                f"pigpiod at {self.address} does not answer: {error}; check the daemon "
                "and the network"
            ) from error

    def check(self) -> None:
        """Raise `LinkLost` if the daemon has closed the connection."""
        if self._closed or not self._notify.is_alive():
            raise LinkLost(f"pigpiod at {self.address} has closed the connection; start it again")

    def close(self) -> None:
        """Close both connections and end the callback thread."""
        self._closed = True
        with suppress(OSError):
            self._pi.stop()
        self._notify.join(JOIN_S)  # it ends by itself if the daemon acknowledges the close
        # Else it waits in `recv`: a shutdown wakes it, which closing the socket would not.
        self._notify_socket.shutdown()
        self._notify.join(JOIN_S)
        self._notify_socket.close()


@contextmanager
def _threads_that_end(library: Any) -> Iterator[None]:
    """A block in which pigpio creates callback threads that end with their connection."""
    thread_class = library._callback_thread

    class CallbackThread(thread_class):  # type: ignore[misc, valid-type] # pigpio has no types
        def start(self) -> None:  # pigpio calls it once the socket is connected
            self.sl.s = _EndingSocket(self)
            super().start()

    library._callback_thread = CallbackThread
    try:
        yield
    finally:
        # Others that use pigpio in this process get its own class.
        library._callback_thread = thread_class


class _EndingSocket:
    """Replaces the socket of the callback thread: when it is closed, the thread ends."""

    def __init__(self, thread: Any) -> None:
        self._socket: socket.socket = thread.sl.s
        self._thread = thread

    def recv(self, size: int) -> bytes:
        try:
            data = self._socket.recv(size)
        except OSError:
            data = b""
        if not data:
            # Else the thread would read nothing again and again.
            self._thread.go = False
        return data

    def send(self, data: bytes) -> None:
        # The thread's `stop` sends a last command, also to a daemon that is gone.
        with suppress(OSError):
            self._socket.send(data)

    def close(self) -> None:
        self._socket.close()

    def shutdown(self) -> None:
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)


def _probe(host: str, port: int, address: str) -> None:
    """Connect once with a time-out and a reason, both of which pigpio's own attempt lacks."""
    try:
        socket.create_connection((host, port), CONNECT_TIMEOUT_S).close()
    except OSError as error:
        raise DriverUnavailable(
            f"no pigpiod at {address} ({error}): start it with `sudo systemctl start pigpiod`, "
            "or give host and port"
        ) from error
