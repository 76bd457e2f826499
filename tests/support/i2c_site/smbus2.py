"""smbus2 on a bus of made-up chips, for processes that find this folder first.

Files in the directory that WHEELWIRE_TEST_I2C names say which buses there are, and what is wrong.
"""

from __future__ import annotations

import enum
import errno
import os
import time
from pathlib import Path

from support.i2c_chips import INA219, MPU6050, Chips

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
        self._was_absent: set[int] = set()

    def i2c_rdwr(self, *messages: i2c_msg) -> None:
        if _is("stuck"):
            while _is("stuck"):
                time.sleep(0.005)
            raise OSError(errno.ETIMEDOUT, "it was stuck")
        if _is("hung"):
            raise OSError(errno.ETIMEDOUT, "it hangs")
        address = messages[0].address
        if _is(f"absent-{address:#x}"):
            self._was_absent.add(address)
            raise OSError(errno.EREMOTEIO, "nobody answers")
        if address in self._was_absent or _is(f"reset-{address:#x}"):
            self._was_absent.discard(address)
            (_here / f"reset-{address:#x}").unlink(missing_ok=True)
            self._chips.by_address[address].power_on()
        self._chips.imu.frozen = _is("frozen")
        data = self._chips.transfer(address, messages[0].data, messages[-1].size)
        if data is None:
            raise OSError(errno.EREMOTEIO, "nobody answers")
        messages[-1].data = data

    def close(self) -> None:
        os.close(self.fd)


def _is(fault: str) -> bool:
    return (_here / fault).exists()


__all__ = ["INA219", "MPU6050", "I2cFunc", "SMBus", "i2c_msg"]
