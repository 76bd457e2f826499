"""A driver on a device in memory, behind a pseudo-terminal."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.core_device import CoreDevice
from support.pty_device import PtyDevice
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.transports import SerialTransport


@pytest.fixture
def device(tmp_path: Path) -> Iterator[PtyDevice]:
    with PtyDevice(tmp_path / "port", CoreDevice(ttl_max_s=5.0)) as device:
        yield device


@pytest.fixture
def robot(device: PtyDevice) -> Iterator[SerialDriver]:
    with SerialDriver(str(device.path)) as robot:
        yield robot


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
