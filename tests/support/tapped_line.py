"""A robot in virtual time, as something to record."""

from __future__ import annotations

import threading
from collections import deque

from wheelwire.link.traffic import Traffic, TrafficReader

from .core_device import UNHURRIED, CoreDevice
from .virtual_line import VirtualLine


class TappedLine:
    """A link that can be listened to.

    Attributes:
        line: Host and device.
        has_ended: Nothing more will come.
    """

    def __init__(self) -> None:
        self.line = VirtualLine(
            device=CoreDevice(seed=2, **UNHURRIED),
            stream_rate_hz=100,
            watched=(1, 2, 3, 4, 5, 6, 7, 8),
        )
        self.has_ended = False
        self._thread = threading.get_ident()
        self._joining: deque[TrafficReader] = deque()
        self.line.open()

    @property
    def traffic(self) -> Traffic:
        return self.line.session.traffic

    def listen_to_traffic(self, reader: TrafficReader) -> None:
        self._joining.append(reader)
        # As with a real link, one thread alone uses the session: a recorder's next file waits.
        if threading.get_ident() == self._thread:
            self._join()

    def _join(self) -> None:
        while self._joining:
            self.line.session.listen(self._joining.popleft(), self.line.now_us)

    def drive(self, seconds: float, left: float = 0.2, right: float = 0.1) -> None:
        for _ in range(round(seconds / 0.05)):
            self.line.drive(left, right)
            self.run(0.05)

    def run(self, seconds: float) -> None:
        self._join()
        self.line.run(seconds)
