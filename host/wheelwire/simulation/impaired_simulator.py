"""A simulated device behind a bad line, in real time: a thread relays between two ports."""

from __future__ import annotations

import contextlib
import fcntl
import os
import select
import termios
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..errors import PortUnavailable
from ..link.clock import host_clock_us
from .bad_line import ImpairedLine, LineEvent, LineProfile
from .simulator import Simulator

READ_SIZE = 1 << 16
MAX_WAIT_S = 0.05
"""Longest wait, after which `close` is noticed."""
REOPEN_S = 0.005
"""Time between two checks whether the device's port is back."""
DRAIN_S = 0.1
"""How long an unplugging waits until the host has read what was delivered, so that the ground truth
can be compared with the host's counters."""
RETRY_S = 0.001
"""Time between two attempts to write to an end whose buffer is full."""
OUTPUT_LIMIT = 1 << 16
"""Most bytes queued for an end that does not read; more are lost."""
_SPEEDS = slice(4, 6)  # ispeed and ospeed in the list of termios.tcgetattr


class ImpairedRelay:
    """Relays between `port` and the device at `device_port` through an impaired line.

    While the device's port is missing, `port` does not exist either.

    Args:
        device_port: Path of the device's port, the same after an unplugging.
        port: Path for the host: a symbolic link that the relay creates.
        profile: The line's impairment.
        reset: Resets the device.
    """

    def __init__(
        self, device_port: Path, port: Path, profile: LineProfile, reset: Callable[[], object]
    ) -> None:
        self.line = ImpairedLine(profile, host_clock_us())
        self.port = port
        self._device_port = device_port
        self._reset = reset
        self._end = threading.Event()
        self._unplugged = False
        self._device: int | None = None
        self._master = self._slave = -1
        self._to_host = self._to_device = b""
        self._thread = threading.Thread(target=self._run, name=f"impaired line {port}", daemon=True)

    def start(self) -> None:
        """Create the port and start the thread.

        Raises:
            PortUnavailable: There is a file with the port's name.
        """
        if self.port.exists() and not self.port.is_symlink():
            raise PortUnavailable(
                str(self.port), "there is a file of that name; choose another name"
            )
        self._plug()
        self._thread.start()

    def close(self) -> None:
        """End the thread and remove the port."""
        self._end.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _run(self) -> None:
        try:
            while not self._end.is_set():
                self._turn()
        finally:
            self._unplug()

    def _turn(self) -> None:
        for event in self.line.advance(host_clock_us()):
            self._obey(event)
        # The device's port may have gone by itself, and may be back.
        if self._device is None and not self._unplugged:
            self._plug()
        device = self._device
        if device is None:
            self._end.wait(min(REOPEN_S, self._wait_s()))
            return
        try:
            # In this order: `_read` waits until the line or an end has something to do.
            self._write(device)
            self._read(device)
        except (OSError, termios.error):  # the device's port is gone: remove ours
            self._unplug()

    def _obey(self, event: LineEvent) -> None:
        if event is LineEvent.RESET:
            self._reset()
        elif event is LineEvent.UNPLUG:
            self._unplugged = True
            self._drain()
            self._unplug()
        else:
            self._unplugged = False
            self._plug()

    # --- ports ---------------------------------------------------------------------------------

    def _plug(self) -> None:
        """Create our port, if the device's exists."""
        if self._device is not None:
            return
        device = _opened(self._device_port)
        if device is None:
            return
        # The slave stays open here as well. Otherwise Linux would report a hang-up on the master
        # while no host has it open. Its settings also show which baud rate the host has chosen.
        self._master, self._slave = os.openpty()
        os.set_blocking(self._master, False)
        tty.setraw(self._slave, termios.TCSANOW)
        self._device = device
        # Renaming is atomic: the name never leads nowhere, even if it existed before.
        fresh = self.port.with_name(self.port.name + ".new")
        fresh.unlink(missing_ok=True)
        fresh.symlink_to(os.ttyname(self._slave))
        fresh.replace(self.port)

    def _unplug(self) -> None:
        if self._device is None:
            return
        # The name first: a host that opens it again must not get the terminal that is about to go.
        self.port.unlink(missing_ok=True)
        for descriptor in (self._device, self._master, self._slave):
            with contextlib.suppress(OSError):
                os.close(descriptor)
        self._device = None
        self._to_host = self._to_device = b""
        self.line.clear()

    def _drain(self) -> None:
        if self._device is None:
            return
        end = time.monotonic() + DRAIN_S
        # Until the host has read everything: the driver's count of what has not been read is 0.
        while any(fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4))) and time.monotonic() < end:
            time.sleep(0.001)

    def _follow_baud_rate(self, device: int) -> None:
        """Copy the baud rate that the host has set on our port to the device's."""
        wanted, current = termios.tcgetattr(self._slave), termios.tcgetattr(device)
        if wanted[_SPEEDS] != current[_SPEEDS]:
            current[_SPEEDS] = wanted[_SPEEDS]
            termios.tcsetattr(device, termios.TCSANOW, current)

    # --- bytes ---------------------------------------------------------------------------------

    def _read(self, device: int) -> None:
        ends = {device: self.line.to_host, self._master: self.line.to_device}
        readable, _, _ = select.select([*ends], [], [], self._wait_s())
        now_us = host_clock_us()
        for descriptor in readable:
            data = os.read(descriptor, READ_SIZE)
            if not data:
                raise OSError("end of file: the device's port is gone")
            ends[descriptor].send(data, now_us)

    def _write(self, device: int) -> None:
        # The simulator garbles bytes by the rate that is set on its own port.
        self._follow_baud_rate(device)
        now_us = host_clock_us()
        self._to_host = _written(self._master, self._to_host, self.line.to_host.take(now_us))
        self._to_device = _written(device, self._to_device, self.line.to_device.take(now_us))

    def _wait_s(self) -> float:
        """Time until the line is due; short while bytes are queued for an end."""
        if self._to_host or self._to_device:
            return RETRY_S
        next_us = self.line.next_us
        if next_us is None:
            return MAX_WAIT_S
        return min(MAX_WAIT_S, max(0.0, (next_us - host_clock_us()) / 1e6))


def _opened(port: Path) -> int | None:
    """Open the device's port in raw mode; None while it does not exist."""
    try:
        descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return None
    try:
        tty.setraw(descriptor, termios.TCSANOW)
    except termios.error:  # gone again
        os.close(descriptor)
        return None
    return descriptor


def _written(descriptor: int, waiting: bytes, pieces: list[bytes]) -> bytes:
    """Write what is queued, then each piece separately; returns what did not fit."""
    # Without new bytes, send the queued ones again.
    for piece in pieces or [b""]:
        waiting += piece
        if waiting:
            # The ends are non-blocking: a full buffer must delay one direction only.
            with contextlib.suppress(BlockingIOError):
                waiting = waiting[os.write(descriptor, waiting) :]
    return waiting if len(waiting) <= OUTPUT_LIMIT else b""


class ImpairedSimulator(Simulator):
    """A `Simulator` whose port is the host's end of a bad line.

    Args:
        profile: The line's impairment.
        link: Path of a symbolic link to the port.
        **options: Those of `Simulator`.
    """

    def __init__(self, profile: LineProfile, *, link: Path | None = None, **options: Any) -> None:
        self._folder = TemporaryDirectory(prefix="wheelwire-")
        device_port = Path(self._folder.name) / "device"
        port = link or Path(self._folder.name) / "robot"
        # Locked is the name that hosts open. The simulator's own port is in a private folder, where
        # no other simulator could take its place.
        arguments = [*options.pop("arguments", ()), f"--lock={port}"]
        super().__init__(link=device_port, arguments=arguments, **options)
        self._relay = ImpairedRelay(device_port, port, profile, self.reset)

    @property
    def port(self) -> str:
        """The port for a host."""
        return str(self._relay.port)

    @property
    def line(self) -> ImpairedLine:
        """The impaired line, with its ground truth."""
        return self._relay.line

    def start(self) -> None:
        """Start the device, then the line."""
        super().start()
        try:
            self._relay.start()
        except BaseException:
            # Otherwise nothing would end the process.
            super().close()
            raise

    def close(self) -> None:
        """End the line, then the device."""
        # In this order: an incident on the line may be about to reset the device.
        self._relay.close()
        super().close()
        self._folder.cleanup()
