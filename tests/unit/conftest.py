from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.pty_device import PtyDevice
from wheelwire.drivers.serial import SerialDriver


@pytest.fixture
def device(tmp_path: Path) -> Iterator[PtyDevice]:
    """A device in memory, behind a pseudo-terminal."""
    with PtyDevice(tmp_path / "port") as device:
        yield device


@pytest.fixture
def robot(device: PtyDevice) -> Iterator[SerialDriver]:
    with SerialDriver(str(device.path)) as robot:
        yield robot
