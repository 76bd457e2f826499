"""A byte stream to a device, behind a file descriptor: a serial port, or a TCP or Unix socket.

`read` and `write` never block; `poll` on `fileno()` tells when they have something to do.
"""

from __future__ import annotations

import errno
import fcntl
import os
import socket
import termios
import weakref
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from typing import ClassVar

import serial

from ..errors import LinkLost, PortUnavailable
from .ports import PSEUDO_TERMINALS, UNIX, final_name, lock_holder, meant_port
from .threads import abandon_in_child

READ_SIZE = 4096
SOCKET_TIMEOUT_S = 5.0

_REMEDIES = {
    errno.ENOENT: (
        "there is no such port; `wheelwire ports` lists the ports, "
        "`wheelwire sim` starts a simulated robot"
    ),
    errno.ENODEV: "the device behind it is gone; plug it in again",
    errno.ENXIO: "the device behind it is gone; plug it in again",
    errno.EIO: "the device behind it is gone; plug it in again",
    errno.EACCES: "not permitted; join its group (`sudo usermod -aG dialout $USER`), log in again",
    errno.EPERM: "not permitted; join its group (`sudo usermod -aG dialout $USER`), log in again",
    errno.ENOTTY: "it is not a serial port; `wheelwire ports` lists them",
    errno.EISDIR: "it is not a serial port; `wheelwire ports` lists them",
    errno.ECONNREFUSED: "nobody listens there; start the peer first",
}


class Transport(ABC):
    """An open byte stream.

    Attributes:
        port: Its name, as it was opened.
        baud_rate: The active one; None if the port has none.
        low_latency: True when the kernel delivers bytes at once, False when it may hold them
            back (FTDI adapters: 16 ms), None where that cannot happen.
        gone: What to say when the other end is gone: what it means, and what happens next.
        longest_pause_s: Longest pause between attempts to reopen it.
    """

    gone: ClassVar[str] = "the peer closed the connection; trying to connect again"
    longest_pause_s: ClassVar[float] = 0.05
    port: str = ""
    baud_rate: int | None = None
    low_latency: bool | None = None

    _fd: int
    """Its descriptor; -1 once it has none."""

    def fileno(self) -> int:
        """For `poll`."""
        return self._fd

    @abstractmethod
    def read(self) -> bytes:
        """What has arrived, possibly nothing.

        Raises:
            LinkLost: The other end is gone.
        """

    def write(self, data: bytes) -> int:
        """Write what fits; returns how many bytes that was.

        Raises:
            LinkLost: The other end is gone.
        """
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise self.lost(error) from error

    def lost(self, error: OSError | termios.error | None = None) -> LinkLost:
        """The error of a lost other end; `error` is how that was noticed, if by one."""
        text = self.gone if error is None else f"{self.gone}: {_text(error)}"
        return LinkLost(text, causes=("cable_pulled",))

    def set_baud_rate(self, baud_rate: int) -> None:  # noqa: B027 - a socket has none
        """Change the baud rate, where there is one."""

    def check(self) -> None:  # noqa: B027 - a socket has nothing that others could change
        """Look whether the port is still as it was opened.

        Raises:
            LinkLost: Another program changed its settings, or it is gone.
        """

    @abstractmethod
    def close(self) -> None:
        """Close it. Never raises; harmless when repeated."""

    @abstractmethod
    def abandon(self) -> None:
        """Close this process's copy of the descriptors and touch nothing else: it was forked."""

    def _release(self, close: Callable[[], object]) -> None:
        """Close the port, but keep the descriptor's number while this object is in use.

        Another thread may be about to write, and the number could by then belong to another file.
        So it leads to /dev/null until `close` frees it, when no thread uses this object any more.
        """
        try:
            nowhere = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
            try:
                # In one step, so that the number is never free. It also closes the port itself.
                os.dup2(nowhere, self._fd, inheritable=False)
            finally:
                os.close(nowhere)
        except OSError:  # no descriptor is left to do it with, or it is closed already
            self._fd = -1
            close()
        else:
            # `close` is a method of what is wrapped: one of this object would keep it alive.
            weakref.finalize(self, close)


class SerialTransport(Transport):
    """A serial port, or whatever else pyserial opens that has a file descriptor."""

    gone = "the port is gone (unplugged?); it is opened again when it is back"

    def __init__(self, port: str, baud_rate: int) -> None:
        # Defaults on purpose: DTR and RTS both asserted leave an ESP32 running, and any order of
        # clearing them before the opening passes through its reset state.
        try:
            # `exclusive` takes a lock that other programs may ignore; `_hold` does more.
            self._serial = serial.serial_for_url(
                port, baudrate=baud_rate, timeout=0, exclusive=True
            )
        except (OSError, termios.error, ValueError) as error:
            raise _unavailable(port, error) from error
        try:
            self._fd = self._serial.fileno()
        except (OSError, AttributeError) as error:
            self._serial.close()
            raise PortUnavailable(
                port, "this kind of URL has no file descriptor: use a port, or socket://HOST:PORT"
            ) from error
        abandon_in_child(self)
        self.baud_rate = baud_rate
        self.low_latency = self._ask_low_latency()
        # A pseudo-terminal would stay shut for other users' programs after this one was killed,
        # for as long as its other end is open. There the lock that pyserial takes has to do.
        self._exclusive = not final_name(port).startswith(PSEUDO_TERMINALS)
        self._settings: list[object] | None = None
        # Anything but a terminal has no settings to hold.
        if os.isatty(self._fd):
            try:
                self._hold(baud_rate)
            except (OSError, termios.error) as error:
                self.close()
                raise _unavailable(port, error) from error

    def _hold(self, baud_rate: int) -> None:
        """Keep other programs out, and undo what the last one left."""
        if self._exclusive:
            # From here on, nobody but root can open it.
            fcntl.ioctl(self._fd, termios.TIOCEXCL)
        # In this order: input, output, control and local flags, both speeds, characters.
        settings = termios.tcgetattr(self._fd)
        # pyserial sets most of these flags, but not BRKINT and its like.
        raw = [0, 0, settings[2], 0, *settings[4:]]
        if raw != settings:
            termios.tcsetattr(self._fd, termios.TCSANOW, raw)
            self._serial.baudrate = baud_rate  # one that termios cannot tell, too
        # Read back, because a driver need not take every flag that it was given.
        self._settings = termios.tcgetattr(self._fd)

    def read(self) -> bytes:
        """What has arrived, possibly nothing."""
        try:
            return os.read(self._fd, READ_SIZE)  # b"" does not mean the end here: VMIN is 0
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self.lost(error) from error

    def set_baud_rate(self, baud_rate: int) -> None:
        """Change the baud rate."""
        try:
            self._serial.baudrate = baud_rate
        except ValueError:
            return  # this adapter cannot; the next rate will be tried
        except (OSError, termios.error) as error:
            raise self.lost(error) from error
        self.baud_rate = baud_rate
        # A change of our own, which `check` must not take for another program's.
        self._settings = self._settings and self._read_settings()

    def check(self) -> None:
        """Look whether another program has changed the port's settings (`stty`, a terminal)."""
        if self._settings and self._read_settings() != self._settings:
            raise LinkLost("another program changed the port's settings; opening it anew")

    def _read_settings(self) -> list[object]:
        try:
            return termios.tcgetattr(self._fd)
        except (OSError, termios.error) as error:
            raise self.lost(error) from error

    def close(self) -> None:
        """Close the port in the order that leaves an ESP32 running."""
        # RTS first: DTR cleared while RTS is set would hold an ESP32 in reset.
        # A pty has no modem lines, and an unplugged adapter nothing at all.
        with suppress(OSError, termios.error):
            self._serial.rts = False
            self._serial.dtr = False
        with suppress(OSError, termios.error):
            if self._exclusive and os.isatty(self._fd):
                # The flag is the terminal's: it lasts as long as any process has it open.
                fcntl.ioctl(self._fd, termios.TIOCNXCL)
        self._release(self._serial.close)

    def abandon(self) -> None:
        """Close the descriptors; modem lines, settings and the lock are left as they are."""
        with suppress(OSError, termios.error):
            self._serial.close()
        self._fd = -1  # the number may be another file's soon

    def _ask_low_latency(self) -> bool | None:
        try:
            self._serial.set_low_latency_mode(True)
        except (OSError, ValueError) as error:
            # A pty has no such flag, and needs none.
            return None if _is_no_terminal(error) else False
        except (AttributeError, NotImplementedError):
            # Only pyserial's own ports on Linux can ask.
            return None
        return True


class SocketTransport(Transport):
    """A connected stream socket, which the transport closes."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self._socket = connection
        self._fd = connection.fileno()
        abandon_in_child(self)

    def read(self) -> bytes:
        """What has arrived, possibly nothing."""
        try:
            data = self._socket.recv(READ_SIZE)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self.lost(error) from error
        # Unlike on a terminal, an empty read means the end of the stream.
        if not data:
            raise self.lost()
        return data

    def close(self) -> None:
        """Close the connection."""
        self._release(self._socket.close)

    def abandon(self) -> None:
        """Close the descriptor: the connection stays, as long as the parent has it."""
        self._socket.close()
        self._fd = -1


class UnixTransport(SocketTransport):
    """A service on this computer."""

    gone = (
        "the service closed the connection: another program uses it, or it has ended; trying to "
        "connect again"
    )


def open_transport(port: str, baud_rate: int) -> Transport:
    """Open a device path, a pyserial URL, `socket://host:port` or `unix:path`.

    Raises:
        PortUnavailable: It is not there, in use, not permitted or not usable.
    """
    transport: Transport
    if port.startswith("socket://"):
        transport = SocketTransport(_connect(port, _connect_tcp))
    elif port.startswith(UNIX):
        transport = UnixTransport(_connect(port, _connect_unix))
    else:
        transport = SerialTransport(port, baud_rate)
    transport.port = port
    return transport


def _connect(port: str, connect: Callable[[str], socket.socket]) -> socket.socket:
    try:
        return connect(port)
    except (OSError, ValueError) as error:
        raise _unavailable(port, error) from error


def _connect_tcp(url: str) -> socket.socket:
    from urllib.parse import urlsplit  # here, for most ports are devices

    try:
        parts = urlsplit(url)
        # Asking for the port raises when it is not a number from 0 to 65535.
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise ValueError("write it as socket://HOST:PORT, such as socket://192.168.1.7:3333")
    connection = socket.create_connection((host, port), timeout=SOCKET_TIMEOUT_S)
    # Otherwise a setpoint could wait in the kernel until the one before it is acknowledged.
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


def _connect_unix(port: str) -> socket.socket:
    if port == UNIX:
        raise ValueError("write it as unix:PATH, such as unix:/run/robot.sock")
    connection = socket.socket(socket.AF_UNIX)
    try:
        connection.settimeout(SOCKET_TIMEOUT_S)
        connection.connect(port.removeprefix(UNIX))
    except BaseException:
        connection.close()
        raise
    return connection


def _unavailable(port: str, error: Exception) -> PortUnavailable:
    number = getattr(error, "errno", None)
    if number is None and _is_no_terminal(error):
        number = errno.ENOTTY
    # From a serial port: EBUSY if another program holds it exclusively, EAGAIN if it is locked.
    if number in (errno.EBUSY, errno.EAGAIN):
        return PortUnavailable(port, _in_use(port), is_in_use=True)
    reason = _REMEDIES.get(number or 0, _text(error))
    hint = meant_port(port) if number == errno.ENOENT else ""
    return PortUnavailable(port, f"{reason}; {hint}" if hint else reason)


def _is_no_terminal(error: Exception) -> bool:
    # pyserial keeps the number of a termios.error only in its text, which is the system's.
    return os.strerror(errno.ENOTTY) in str(error)


def _in_use(port: str) -> str:
    holder = lock_holder(port)
    if holder == os.getpid():
        return (
            "this program has it open already, and only one robot object can: use that one, or "
            "close it first (`robot.close()`; in a notebook it may be of an earlier cell)"
        )
    named = ""
    if holder is not None:
        from .program_names import process_name  # here, for most ports are free

        named = f" ({process_name(holder)})"
    return (
        f"another program uses it{named}, and only one can: end that "
        "one with Ctrl-C (a Wheelwire program stops the robot as it ends), or use the robot's "
        "e-stop button"
    )


def _text(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
