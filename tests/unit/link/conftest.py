"""A device in memory: behind a pseudo-terminal, or on a line in virtual time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from support.core_device import CoreDevice
from support.pty_device import PtyDevice
from support.virtual_line import VirtualLine
from wheelwire.link.transports import SerialTransport


@pytest.fixture
def device(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(tmp_path / "port", CoreDevice(ttl_max_s=5.0)) as device:
        yield device


@pytest.fixture
def line() -> VirtualLine:
    """A session that is open, and its device, on a line in virtual time."""
    return VirtualLine().open()


@pytest.fixture
def writers(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The threads that have written to a port, one for each write."""
    threads: list[int] = []
    write = SerialTransport.write

    def noting(self: SerialTransport, data: bytes) -> int:
        threads.append(threading.get_ident())
        return write(self, data)

    monkeypatch.setattr(SerialTransport, "write", noting)
    return threads


@pytest.fixture
def lose_own_writes(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """From this call on, what the test's own thread writes to a port is lost on the line."""
    write, own = SerialTransport.write, threading.get_ident()

    def losing(self: SerialTransport, data: bytes) -> int:
        return len(data) if threading.get_ident() == own else write(self, data)

    return partial(monkeypatch.setattr, SerialTransport, "write", losing)
