"""This computer's I2C buses: a process for each reads it, with the firmware's drivers, by smbus2.

A transfer on a hung bus waits in the kernel, and nothing can end it there. So neither the core nor
the guard may wait for a process that makes transfers. The core's process starts the reader as a
child before it claims any pin, and shares only the memory of `Sensors` with it.
"""

from __future__ import annotations

import errno
import os
import select
import signal
import time
import traceback
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from wheelwire_protocol.core import Sensors, TransferResult

from ..errors import DriverUnavailable
from . import guard

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


LONGEST_PAUSE_US = 100_000
"""The longest pause between two polls of the bus."""
END_S = 0.1
"""How long `close` waits for killed readers, which may be in a transfer."""

Transfer = Callable[[int, bytes, int], tuple[TransferResult, bytes]]


class BusReaders:
    """Runs until it is closed, or this process ends.

    Args:
        sensors: The drivers, and what they read.
        numbers: Numbers of the buses.
        start_ns: Start of the device's clock, by `time.monotonic_ns`.

    Raises:
        DriverUnavailable: A bus cannot be opened.
    """

    def __init__(self, sensors: Sensors, numbers: Iterable[int], start_ns: int) -> None:
        def now_us() -> int:
            return (time.monotonic_ns() - start_ns) // 1000

        self._pids: list[int] = []
        buses: dict[int, I2cBus] = {}
        try:
            # All buses first: this process reports what is wrong with one.
            for number in numbers:
                buses[number] = I2cBus(number)
            for number, bus in buses.items():
                self._pids.append(_fork(BusReader(sensors, number, bus.transfer, now_us), bus))
        except BaseException:
            self.close()
            raise
        finally:
            for bus in buses.values():
                bus.close()

    def close(self) -> None:
        """Kill the readers. One that makes a transfer ends when the kernel ends that."""
        for pid in self._pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        until = time.monotonic() + END_S
        while self._pids and time.monotonic() < until:
            self._pids = [pid for pid in self._pids if not _reaped(pid)]
            time.sleep(0.001)
        self._pids = []


class BusReader:
    """Reads one bus: what is due, when it is due.

    Args:
        sensors: What is read.
        number: Number of the bus.
        transfer: Makes a transfer on the bus.
        now_us: The device's clock.
    """

    def __init__(
        self, sensors: Sensors, number: int, transfer: Transfer, now_us: Callable[[], int]
    ) -> None:
        self._sensors = sensors
        self._number = number
        self._transfer = transfer
        self._now_us = now_us

    def poll(self) -> float:
        """Do what is due; returns for how many seconds there is nothing to do."""
        due_us = self._sensors.poll(self._number, self._now_us(), self._carry)
        return min(max(0, due_us - self._now_us()), LONGEST_PAUSE_US) / 1e6

    def _carry(self, address: int, out: bytes, size: int) -> tuple[TransferResult, bytes, int]:
        try:
            result, data = self._transfer(address, out, size)
        except Exception:  # an unforeseen one must not look like an answer
            traceback.print_exc()
            result, data = TransferResult.HUNG, b""
        return result, data, self._now_us()


def _fork(reader: BusReader, bus: I2cBus) -> int:
    core = os.getpid()
    pid = os.fork()
    if pid == 0:
        try:
            _run(reader, bus, core)
        except BaseException:
            traceback.print_exc()
        os._exit(0)  # not sys.exit: the exit handlers belong to the core's process
    return pid


def _run(reader: BusReader, bus: I2cBus, core: int) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    # The application has to see its socket close when the core ends, and so has the guard.
    os.closerange(3, bus.fd)
    os.closerange(bus.fd + 1, os.sysconf("SC_OPEN_MAX"))
    ending = os.pidfd_open(core)
    if os.getppid() != core:
        return
    guard.request_realtime(guard.READER_PRIORITY)
    wait_s = 0.0
    while not select.select([ending], [], [], wait_s)[0]:
        wait_s = reader.poll()


def _reaped(pid: int) -> bool:
    try:
        return os.waitpid(pid, os.WNOHANG)[0] == pid
    except ChildProcessError:
        return True
