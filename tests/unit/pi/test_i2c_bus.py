"""An I2C bus by the real smbus2, with the kernel's answers made up."""

from __future__ import annotations

import builtins
import ctypes
import errno
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import smbus2.smbus2 as library

from wheelwire.errors import DriverUnavailable
from wheelwire.pi.i2c import I2cBus
from wheelwire_protocol.core import TransferResult

READ = 1
"""The flag I2C_M_RD of a message."""


class Kernel:
    """Opens a bus, and answers the two requests that are used.

    Attributes:
        error: Of the next requests; 0: none.
        open_error: As `error`, of opening a bus.
        functions: What the bus can do.
        messages: Of the transfers: address, whether it reads, bytes written.
        paths: What was opened.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.error = self.open_error = 0
        self.functions = library.I2cFunc.I2C
        self.messages: list[list[tuple[int, bool, bytes]]] = []
        self.paths: list[str] = []
        self.open_fds: set[int] = set()
        names = SimpleNamespace(open=self._open, close=self._close, O_RDWR=os.O_RDWR)
        monkeypatch.setattr(library, "os", names)
        monkeypatch.setattr(library, "ioctl", self._ioctl)

    def _open(self, path: str, _flags: int) -> int:
        if self.open_error:
            raise OSError(self.open_error, os.strerror(self.open_error), path)
        self.paths.append(path)
        self.open_fds.add(len(self.paths))
        return len(self.paths)

    def _close(self, fd: int) -> None:
        self.open_fds.remove(fd)

    def _ioctl(self, fd: int, request: int, data: Any) -> int:
        assert fd in self.open_fds
        if request == library.I2C_FUNCS:
            data.value = int(self.functions)
            return 0
        assert request == library.I2C_RDWR
        if self.error:
            raise OSError(self.error, os.strerror(self.error))
        messages = []
        for message in data.msgs[: data.nmsgs]:
            reads = bool(message.flags & READ)
            written = b"" if reads else ctypes.string_at(message.buf, message.len)
            messages.append((message.addr, reads, written))
            if reads:
                ctypes.memmove(message.buf, bytes(range(message.len)), message.len)
        self.messages.append(messages)
        return 0


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Iterator[Kernel]:
    return Kernel(monkeypatch)  # type: ignore[return-value]


def test_a_read_is_one_transfer_with_a_repeated_start(kernel: Kernel) -> None:
    bus = I2cBus(1)
    assert kernel.paths == ["/dev/i2c-1"]
    assert bus.transfer(0x68, b"\x3b", 14) == (TransferResult.DONE, bytes(range(14)))
    assert kernel.messages == [[(0x68, False, b"\x3b"), (0x68, True, b"")]]


def test_a_write_reads_nothing(kernel: Kernel) -> None:
    assert I2cBus(1).transfer(0x40, b"\x00\x3d\xdf", 0) == (TransferResult.DONE, b"")
    assert kernel.messages == [[(0x40, False, b"\x00\x3d\xdf")]]


@pytest.mark.parametrize(
    ("error", "result"),
    [
        (errno.EREMOTEIO, TransferResult.NO_ANSWER),
        (errno.ENXIO, TransferResult.NO_ANSWER),
        (errno.ETIMEDOUT, TransferResult.HUNG),
        (errno.EIO, TransferResult.HUNG),
        (errno.EAGAIN, TransferResult.HUNG),
        (errno.EBUSY, TransferResult.HUNG),
    ],
)
def test_errors_of_the_kernel_become_transfer_results(
    kernel: Kernel, error: int, result: TransferResult
) -> None:
    bus = I2cBus(1)
    kernel.error = error
    assert bus.transfer(0x68, b"\x75", 1) == (result, b"")
    kernel.error = 0
    assert bus.transfer(0x68, b"\x75", 1) == (TransferResult.DONE, b"\x00")
    assert len(kernel.paths) == 1


def test_a_bus_that_is_unplugged_and_plugged_is_opened_again(kernel: Kernel) -> None:
    bus = I2cBus(7)
    kernel.error, kernel.open_error = errno.ENODEV, errno.ENOENT
    for _ in range(3):
        assert bus.transfer(0x68, b"\x75", 1) == (TransferResult.NO_ANSWER, b"")
        assert not kernel.open_fds  # or the kernel could not remove it
    kernel.error = kernel.open_error = 0
    assert bus.transfer(0x68, b"\x75", 1) == (TransferResult.DONE, b"\x00")
    assert kernel.paths == ["/dev/i2c-7", "/dev/i2c-7"]
    bus.close()
    bus.close()
    assert not kernel.open_fds


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (errno.ENOENT, "/dev/i2c-1 does not exist"),
        (errno.EACCES, "/dev/i2c-1 belongs to the group i2c: run `sudo usermod -aG i2c"),
        (errno.EBUSY, "/dev/i2c-1 cannot be opened: Device or resource busy"),
    ],
)
def test_an_unavailable_bus_says_what_to_do(kernel: Kernel, error: int, words: str) -> None:
    kernel.open_error = error
    with pytest.raises(DriverUnavailable) as raised:
        I2cBus(1)
    assert str(raised.value).startswith(words)


def test_a_missing_bus_names_those_that_are_there(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for number in (20, 21):
        (tmp_path / f"i2c-{number}").touch()
    glob = Path.glob
    monkeypatch.setattr(Path, "glob", lambda _, pattern: glob(tmp_path, pattern))
    kernel.open_error = errno.ENOENT
    with pytest.raises(DriverUnavailable, match="there are the buses 20, 21: switch the bus on"):
        I2cBus(1)


def test_a_bus_of_commands_only_is_refused(kernel: Kernel) -> None:
    kernel.functions = library.I2cFunc.SMBUS_READ_BYTE
    with pytest.raises(DriverUnavailable, match="carries SMBus commands only"):
        I2cBus(1)
    assert not kernel.open_fds


def test_without_smbus2_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    imported: Callable[..., Any] = builtins.__import__

    def import_(name: str, *rest: Any) -> Any:
        if name == "smbus2":
            raise ImportError(name)
        return imported(name, *rest)

    monkeypatch.setattr(builtins, "__import__", import_)
    with pytest.raises(DriverUnavailable, match=r"run pip install 'wheelwire\[pi\]'"):
        I2cBus(1)
