"""A port whose device answers within the write, so that nothing depends on another thread."""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import suppress

from support.core_device import CoreDevice
from wheelwire.link.clock import host_clock_us
from wheelwire.link.transports import Transport
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import AnyMessage


class Port(Transport):
    """A port with a device at its other end, or none.

    Args:
        device: Answers whatever is written.
        accepts: Asked at each write: False takes no byte.
    """

    def __init__(
        self, device: CoreDevice | None = None, accepts: Callable[[], bool] = lambda: True
    ) -> None:
        self.ours, self.theirs = socket.socketpair()
        self.ours.setblocking(False)  # it is also read when nothing is known to be there
        self.written: list[bytes] = []
        self._device = device
        self._accepts = accepts

    def fileno(self) -> int:
        return self.ours.fileno()

    def read(self) -> bytes:
        try:
            return self.ours.recv(4096)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        if not self._accepts():
            return 0
        self.written.append(data)
        if self._device:
            now_us = host_clock_us()
            self._device.feed(data, now_us)
            self._device.advance(now_us)
            with suppress(OSError):  # a test that unplugs it has closed the other end
                self.theirs.sendall(self._device.take_output())
        return len(data)

    def close(self) -> None:
        self.ours.close()
        self.theirs.close()

    def abandon(self) -> None:
        self.close()

    def messages(self) -> list[AnyMessage]:
        return Decoder().feed(b"".join(self.written))
