"""The core behind a pseudo-terminal, in real time, reached through a symlink."""

from __future__ import annotations

import os
import select
import threading
import time
import tty
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from .core_device import CoreDevice


class LineEnd(Protocol):
    """What is at the other end of the line."""

    def feed(self, data: bytes, now_us: int) -> None: ...
    def advance(self, now_us: int) -> None: ...
    def take_output(self) -> bytes: ...


class PtyDevice:
    """Serves a `CoreDevice`, or what is `before` it, at `path`; can be unplugged."""

    def __init__(
        self, path: Path, device: CoreDevice | None = None, before: LineEnd | None = None
    ) -> None:
        self.path = path
        self.device = device or CoreDevice()
        self._before = before
        self._end = threading.Event()
        self._thread: threading.Thread | None = None
        self.plug()

    def plug(self) -> None:
        """A new pseudo-terminal behind the old name."""
        master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(slave))
        self._end.clear()
        self._thread = threading.Thread(target=self._serve, args=(master, slave))
        self._thread.start()

    def unplug(self) -> None:
        """Remove the port, even while a program has it open."""
        # The name first: the number of a pseudo-terminal is given to the next one that is made, and
        # a driver that opens the name again at once would be on somebody else's.
        self.path.unlink(missing_ok=True)
        self._end.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def replace(self, device: CoreDevice) -> CoreDevice:
        """Plug in another device under the same name; returns it."""
        self.unplug()
        self.device = device
        self.plug()
        return device

    def __enter__(self) -> PtyDevice:
        return self

    def __exit__(self, *_: object) -> None:
        self.unplug()

    def _serve(self, master: int, slave: int) -> None:
        line_end = self._before or self.device
        poller = select.poll()
        poller.register(master, select.POLLIN)
        while not self._end.is_set():
            events = poller.poll(1)
            now_us = time.monotonic_ns() // 1000
            if events:
                line_end.feed(os.read(master, 4096), now_us)
            line_end.advance(now_us)
            output = line_end.take_output()
            if output:
                with suppress(BlockingIOError):  # nobody reads: the bytes are lost, as on a wire
                    os.write(master, output)
        os.close(slave)
        os.close(master)
