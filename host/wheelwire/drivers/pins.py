"""What the drivers of this computer's own pins share: the process that moves them."""

from __future__ import annotations

import logging
from dataclasses import replace
from functools import partial
from pathlib import Path

from ..arguments import path, whole
from ..board import BoardDescription
from ..errors import InvalidArgument, shown
from ..files.pins import Pins
from ..link.base_link import LinkOptions
from ..link.connection import Link
from ..link.transports import Transport
from ..linux_mcu.launch import launch
from ..linux_mcu.settings import McuSettings
from ..linux_mcu.store import converted_store
from .transport_driver import DeviceDriver, link_options

MAX_CORE_TIMEOUT_MS = 60_000

_log = logging.getLogger("wheelwire")


class PinProcess:
    """The process that moves this computer's pins, started again whenever it has ended.

    Args:
        settings: Of that process.
        store: A file that keeps parameters which are saved at run time.

    Attributes:
        limits: What the wiring cannot do, in sentences; logged once as warnings.

    Raises:
        InvalidArgument: The settings are of a wrong type or size.
    """

    def __init__(self, settings: McuSettings, store: Path | None) -> None:
        settings = replace(
            settings,
            core_timeout_ms=whole(
                "core_timeout_ms", settings.core_timeout_ms, 1, MAX_CORE_TIMEOUT_MS
            ),
        )
        if store is not None:
            # Here: the process itself reads no other format than the core's.
            settings = replace(settings, store=str(converted_store(path("store", store))))
        self.limits: tuple[str, ...] = ()
        self._settings = settings

    @property
    def options(self) -> LinkOptions:
        """Of the link to it."""
        return link_options(self._settings.backend, self._open)

    def _open(self, _baud_rate: int) -> Transport:
        transport = launch(self._settings)
        # The process is started again after every loss: its limits are logged when they change.
        if transport.limits != self.limits:
            self.limits = transport.limits
            for limit in self.limits:
                _log.warning("%s: %s", self._settings.backend, limit)
        return transport


def checked_pins(pins: BoardDescription | None) -> BoardDescription:
    """The wiring, if it is one; None: that of the guide."""
    if pins is None:
        return Pins()
    if isinstance(pins, BoardDescription):
        return pins
    raise InvalidArgument(f"pins = {shown(pins)}: give `wheelwire.Pins(...)`, or another board")


class PinDriver(DeviceDriver):
    """A robot whose core runs in a process of this computer.

    Args:
        process: That process.

    Raises:
        DriverUnavailable: The pins cannot be had, or what they need is not installed.
        ConfigurationError: The pins or the store do not fit.
        UnknownParameter: In the settings' parameters.
        ParameterOutOfRange: In the settings' parameters.
    """

    def __init__(self, process: PinProcess) -> None:
        self._process = process
        super().__init__(partial(Link, process.options))

    @property
    def limits(self) -> tuple[str, ...]:
        """What this wiring cannot do, in sentences; logged once as warnings."""
        return self._process.limits
