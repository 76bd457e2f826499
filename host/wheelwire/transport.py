"""A byte stream to a device, behind a file descriptor: a serial port or a `socket://` peer.

`read` and `write` never block; `poll` on `fileno()` tells when they have something to do.
"""

from __future__ import annotations

import errno
import os
import socket
import termios
from abc import ABC, abstractmethod
from contextlib import suppress
from urllib.parse import urlsplit

import serial

from .errors import LinkLost, PortUnavailable

READ_SIZE = 4096
SOCKET_TIMEOUT_S = 5.0

_REMEDIES = {
    errno.ENOENT: "there is no such port; `wheelwire ports` lists those there are",
    errno.ENODEV: "the device behind it is gone; plug it in again",
    errno.ENXIO: "the device behind it is gone; plug it in again",
    errno.EIO: "the device behind it is gone; plug it in again",
    errno.EACCES: "not permitted; join its group (`sudo usermod -aG dialout $USER`), log in anew",
    errno.EPERM: "not permitted; join its group (`sudo usermod -aG dialout $USER`), log in anew",
    errno.EBUSY: "another program uses it; close that one",
    errno.EAGAIN: "another program uses it; close that one",
    errno.ENOTTY: "it is no serial port; `wheelwire ports` lists those there are",
    errno.EISDIR: "it is no serial port; `wheelwire ports` lists those there are",
    errno.ECONNREFUSED: "nobody listens there; start the peer first",
}


class Transport(ABC):
    """An open byte stream.

    Attributes:
        port: Its name, as it was opened.
        baud_rate: In force; None where there is none.
        low_latency: True when the kernel delivers bytes at once, False when it may hold them
            back (FTDI adapters: 16 ms), None where the question does not arise.
    """

    port: str = ""
    baud_rate: int | None = None
    low_latency: bool | None = None

    @abstractmethod
    def fileno(self) -> int:
        """For `poll`."""

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
            return os.write(self.fileno(), data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise _lost(error) from error

    def set_baud_rate(self, baud_rate: int) -> None:  # noqa: B027 - a socket has none
        """Change the baud rate, where there is one."""

    @abstractmethod
    def close(self) -> None:
        """Close it. Never raises; harmless when repeated."""


class SerialTransport(Transport):
    """A serial port, or whatever else pyserial opens that has a file descriptor."""

    def __init__(self, port: str, baud_rate: int) -> None:
        # Defaults on purpose: DTR and RTS both asserted leave an ESP32 running, and any order of
        # clearing them before the opening passes through its reset state.
        try:
            self._serial = serial.serial_for_url(
                port, baudrate=baud_rate, timeout=0, exclusive=True
            )
        except (OSError, termios.error, ValueError) as error:
            raise _unavailable(port, error) from error
        try:
            self._fd = self._serial.fileno()
        except (OSError, AttributeError) as error:
            self._serial.close()
            raise PortUnavailable(port, "this kind of URL has no file descriptor") from error
        self.baud_rate = baud_rate
        self.low_latency = self._ask_low_latency()

    def fileno(self) -> int:
        """For `poll`."""
        return self._fd

    def read(self) -> bytes:
        """What has arrived, possibly nothing."""
        try:
            return os.read(self._fd, READ_SIZE)  # b"" is no end here: VMIN is 0
        except BlockingIOError:
            return b""
        except OSError as error:
            raise _lost(error) from error

    def set_baud_rate(self, baud_rate: int) -> None:
        """Change the baud rate."""
        try:
            self._serial.baudrate = baud_rate
        except ValueError:
            return  # this adapter cannot; the next rate will be tried
        except (OSError, termios.error) as error:
            raise _lost(error) from error
        self.baud_rate = baud_rate

    def close(self) -> None:
        """Close the port in the order that leaves an ESP32 running."""
        # RTS first: DTR cleared while RTS is set would hold an ESP32 in reset.
        # A pty has no modem lines, and an unplugged adapter nothing at all.
        with suppress(OSError, termios.error):
            self._serial.rts = False
            self._serial.dtr = False
        with suppress(OSError, termios.error):
            self._serial.close()

    def _ask_low_latency(self) -> bool | None:
        try:
            self._serial.set_low_latency_mode(True)
        except (OSError, ValueError) as error:
            # pyserial keeps the errno in the text only; a pty has no such flag, and needs none.
            return None if "Inappropriate ioctl" in str(error) else False
        except (AttributeError, NotImplementedError):
            return None
        return True


class SocketTransport(Transport):
    """A TCP peer, `socket://host:port`: a serial server or a simulated device."""

    def __init__(self, url: str) -> None:
        try:
            parts = urlsplit(url)
            address = (parts.hostname or "", parts.port or 0)
            self._socket = socket.create_connection(address, timeout=SOCKET_TIMEOUT_S)
        except (OSError, ValueError) as error:
            raise _unavailable(url, error) from error
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def fileno(self) -> int:
        """For `poll`."""
        return self._socket.fileno()

    def read(self) -> bytes:
        """What has arrived, possibly nothing."""
        try:
            data = self._socket.recv(READ_SIZE)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise _lost(error) from error
        if not data:
            raise LinkLost("the peer closed the connection; trying to connect again")
        return data

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


def open_transport(port: str, baud_rate: int) -> Transport:
    """Open a device path, a pyserial URL or `socket://host:port`.

    Raises:
        PortUnavailable: It is not there, in use, not permitted or not usable.
    """
    is_socket = port.startswith("socket://")
    transport = SocketTransport(port) if is_socket else SerialTransport(port, baud_rate)
    transport.port = port
    return transport


def hung_up() -> LinkLost:
    """The error of a port whose device is unplugged."""
    return LinkLost("the port is gone (unplugged?); it is opened again when it is back")


def _lost(error: OSError | termios.error) -> LinkLost:
    return LinkLost(f"{hung_up()}: {_text(error)}")


def _unavailable(port: str, error: Exception) -> PortUnavailable:
    # pyserial keeps the errno, but buries that of a termios.error in its text.
    number = getattr(error, "errno", None)
    if number is None and "Inappropriate ioctl" in str(error):
        number = errno.ENOTTY
    return PortUnavailable(port, _REMEDIES.get(number or 0, _text(error)))


def _text(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
