"""An I2C bus of this computer, by smbus2."""

from __future__ import annotations

import errno
from contextlib import suppress
from pathlib import Path
from typing import Any

from wheelwire_protocol.native import TransferResult

from ..errors import DriverUnavailable

NO_ANSWER = (errno.EREMOTEIO, errno.ENXIO)
"""No chip answers, from the drivers of a Raspberry Pi's buses. EIO is a clock held low too long."""
GONE = (errno.ENODEV, errno.EBADF, errno.ESHUTDOWN)
"""The bus was unplugged: it is opened again with the next transfer."""
_DEVICE = "/dev/i2c-{}"


class I2cBus:
    """An open bus.

    Args:
        number: N of /dev/i2c-N.

    Raises:
        DriverUnavailable: smbus2 is not installed, or the bus is not there, belongs to others, or
            carries no transfers of this kind.
    """

    def __init__(self, number: int) -> None:
        self._number = number
        try:
            import smbus2
        except ImportError as error:
            raise DriverUnavailable(
                "sensors on this computer's I2C bus need smbus2: run pip install 'wheelwire[pi]'"
            ) from error
        self._library: Any = smbus2
        try:
            self._bus: Any = smbus2.SMBus(number)
        except OSError as error:
            raise DriverUnavailable(_reason(number, error)) from error
        if not self._bus.funcs & smbus2.I2cFunc.I2C:
            self._bus.close()
            raise DriverUnavailable(
                f"{_DEVICE.format(number)} carries SMBus commands only: connect the sensors to "
                "another bus"
            )

    @property
    def fd(self) -> int:
        """Its descriptor."""
        return int(self._bus.fd)

    def transfer(self, address: int, out: bytes, size: int) -> tuple[TransferResult, bytes]:
        """Write, then read `size` bytes after a repeated start, unless it is 0. Raises nothing."""
        message = self._library.i2c_msg
        written = message.write(address, out)
        read = message.read(address, size)
        try:
            if self._bus is None:
                self._bus = self._library.SMBus(self._number)
            self._bus.i2c_rdwr(*([written, read] if size else [written]))
        except OSError as error:
            return self._failure(error), b""
        return TransferResult.DONE, bytes(read)

    def close(self) -> None:
        """Close it."""
        bus, self._bus = self._bus, None
        if bus is not None:
            with suppress(OSError):
                bus.close()

    def _failure(self, error: OSError) -> TransferResult:
        if self._bus is None or error.errno in GONE:
            # Kept open it would keep the kernel from removing it, and never come back.
            self.close()
            return TransferResult.NO_ANSWER
        return TransferResult.NO_ANSWER if error.errno in NO_ANSWER else TransferResult.HUNG


def _reason(number: int, error: OSError) -> str:
    device = _DEVICE.format(number)
    if isinstance(error, FileNotFoundError):
        there = sorted(path.name.removeprefix("i2c-") for path in Path("/dev").glob("i2c-*"))
        known = f"; there are the buses {', '.join(there)}" if there else ""
        return (
            f"{device} does not exist{known}: switch the bus on with `sudo raspi-config nonint "
            "do_i2c 0`, or correct `bus` in the robot's file"
        )
    if isinstance(error, PermissionError):
        return (
            f"{device} belongs to the group i2c: run `sudo usermod -aG i2c $USER` and log in again"
        )
    return f"{device} cannot be opened: {error.strerror}"
