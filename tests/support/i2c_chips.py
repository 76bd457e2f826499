"""An MPU-6050 and an INA219 by their registers, on a bus with faults; the caller gives the time."""

from __future__ import annotations

import struct
from collections.abc import Callable

MPU6050, INA219 = 0x68, 0x40
PERIOD_US = 5_000
SLEEP = 0x40
"""PWR_MGMT_1 after power-on."""
POWER_CONFIGURATION = 0x399F
"""An INA219's after power-on."""


class Mpu6050:
    """Takes a sample each 5 ms, once it was woken; after power-on it sleeps.

    Attributes:
        gyro: What it measures, in counts.
        taken_us: When each of the samples in its registers was taken.
    """

    def __init__(self) -> None:
        self.gyro = (0, 0, 0)
        self.power_on()

    def power_on(self) -> None:
        """As after a dip of its supply."""
        self._registers = bytearray(128)
        self._registers[0x6B] = SLEEP
        self._registers[0x75] = MPU6050
        self.taken_us = 0

    def write(self, data: bytes, _now_us: int) -> None:
        at = data[0]
        self._registers[at : at + len(data) - 1] = data[1:]

    def read(self, at: int, size: int, now_us: int) -> bytes:
        self._sample(now_us)
        return bytes(self._registers[at : at + size])

    def _sample(self, now_us: int) -> None:
        due_us = now_us - now_us % PERIOD_US
        if self._registers[0x6B] & SLEEP or due_us <= self.taken_us:
            return
        self.taken_us = due_us
        noise = due_us // PERIOD_US % 7
        counts = (noise, noise, 8192 + noise, 1000, *(one + noise for one in self.gyro))
        self._registers[0x3B : 0x3B + 14] = struct.pack(">7h", *counts)


class Ina219:
    """Measures at once.

    Attributes:
        millivolts: Of the supply.
    """

    def __init__(self) -> None:
        self.millivolts = 11_400
        self.power_on()

    def power_on(self) -> None:
        """As after a dip of its supply."""
        self._configuration = POWER_CONFIGURATION

    def write(self, data: bytes, _now_us: int) -> None:
        if data[0] == 0:
            self._configuration = int.from_bytes(data[1:], "big")

    def read(self, at: int, size: int, _now_us: int) -> bytes:
        shunt = 5000  # 500 mA through 100 mOhm, 10 uV a count
        value = {0: self._configuration, 1: shunt, 2: self.millivolts // 4 << 3}[at]
        return value.to_bytes(size, "big")


class Chips:
    """The chips on a bus.

    Args:
        now_us: The time.

    Attributes:
        by_address: Those that answer.
        transfers: How many there were.
    """

    def __init__(self, now_us: Callable[[], int]) -> None:
        self._now_us = now_us
        self.imu, self.power = Mpu6050(), Ina219()
        self.by_address: dict[int, Mpu6050 | Ina219] = {MPU6050: self.imu, INA219: self.power}
        self.transfers = 0

    def transfer(self, address: int, out: bytes, size: int) -> bytes | None:
        """What is read; None: no chip answers."""
        self.transfers += 1
        chip = self.by_address.get(address)
        if chip is None:
            return None
        if size:
            return chip.read(out[0], size, self._now_us())
        chip.write(out, self._now_us())
        return b""
