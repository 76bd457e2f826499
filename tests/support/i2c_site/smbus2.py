"""smbus2 on a bus of made-up chips, for processes that find this folder first.

Files in the directory that WHEELWIRE_TEST_I2C names say which buses there are, and what is wrong.
"""

from __future__ import annotations

import enum
import errno
import os
import time
from pathlib import Path

from support.i2c_chips import Chips

DIRECTORY = "WHEELWIRE_TEST_I2C"
_here = Path(os.environ[DIRECTORY])


class I2cFunc(enum.IntFlag):
    I2C = 1


class i2c_msg:  # noqa: N801 - its name in smbus2
    def __init__(self, address: int, data: bytes, size: int) -> None:
        self.address, self.data, self.size = address, data, size

    @staticmethod
    def read(address: int, length: int) -> i2c_msg:
        return i2c_msg(address, b"", length)

    @staticmethod
    def write(address: int, buf: bytes) -> i2c_msg:
        return i2c_msg(address, bytes(buf), 0)

    def __bytes__(self) -> bytes:
        return self.data


class SMBus:
    def __init__(self, bus: int) -> None:
        self.fd = os.open(_here / f"bus-{bus}", os.O_RDWR)
        self.funcs = I2cFunc.I2C
        self._chips = Chips(lambda: time.monotonic_ns() // 1000)

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        stuck = _here / "stuck"
        if stuck.exists():
            while stuck.exists():
                time.sleep(0.005)
            raise OSError(errno.ETIMEDOUT, "it was stuck")
        first, last = messages[0], messages[-1]
        data = self._chips.transfer(first.address, first.data, last.size)
        if data is None:
            raise OSError(errno.EREMOTEIO, "nobody answers")
        last.data = data

    def close(self) -> None:
        os.close(self.fd)
