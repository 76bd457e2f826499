"""The process that moves this computer's pins, which its drivers share."""

from __future__ import annotations

from functools import partial

from ..link import LOG
from ..link.connection import Link
from ..link.transports import Transport
from ..pi.launch import launch
from ..pi.settings import McuSettings
from ..robot.robot import Robot
from .options import DeviceOptions


class PinProcess:
    """The process that moves this computer's pins, started again whenever it has ended.

    Args:
        settings: Settings of that process.

    Attributes:
        limits: What the wiring cannot do, in sentences; logged once as warnings.
    """

    def __init__(self, settings: McuSettings) -> None:
        self.limits: tuple[str, ...] = ()
        self._settings = settings

    def open(self, _baud_rate: int) -> Transport:
        """Start the process; returns the line to it."""
        transport = launch(self._settings)
        # The process is started again after every loss: its limits are logged when they change.
        if transport.limits != self.limits:
            self.limits = transport.limits
            for limit in self.limits:
                LOG.warning("%s: %s", self._settings.backend, limit)
        return transport


class PinDriver(Robot):
    """A robot whose core runs in a process of this computer.

    Args:
        settings: Settings of that process.
        tap: See `SerialDriver`.

    Raises:
        DriverUnavailable: The pins are not available, or what they need is not installed.
        ConfigurationError: The pins or the store do not fit.
        InvalidArgument: `tap` is not a bool.
    """

    def __init__(self, settings: McuSettings, *, tap: bool) -> None:
        self._process = PinProcess(settings)
        options = DeviceOptions(tap=tap).link_to(settings.backend, self._process.open)
        super().__init__(partial(Link, options._replace(identity=settings.identity)))

    @property
    def limits(self) -> tuple[str, ...]:
        """What this wiring cannot do, in sentences; logged once as warnings."""
        return self._process.limits
