"""What the drivers of this computer's own pins share: the process that moves them."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

from ..arguments import path, whole
from ..errors import InvalidArgument, shown
from ..link.transports import Transport
from ..linux_mcu.launch import launch
from ..linux_mcu.pins import Pins
from ..linux_mcu.settings import McuSettings
from ..linux_mcu.store import converted_store
from .transport_driver import TransportDriver

MAX_CORE_TIMEOUT_MS = 60_000

log = logging.getLogger("wheelwire")


class PinDriver(TransportDriver):
    """A robot whose core runs in a process of this computer.

    Args:
        settings: Of that process.
        store: A file that keeps parameters which are saved at run time.

    Raises:
        DriverUnavailable: The pins cannot be had, or what they need is not installed.
        ConfigurationError: The pins or the store do not fit.
        UnknownParameter: In the settings' parameters.
        ParameterOutOfRange: In the settings' parameters.
    """

    def __init__(self, settings: McuSettings, store: Path | None) -> None:
        settings = replace(
            settings,
            core_timeout_ms=whole(
                "core_timeout_ms", settings.core_timeout_ms, 1, MAX_CORE_TIMEOUT_MS
            ),
        )
        if not isinstance(settings.pins, Pins):
            raise InvalidArgument(f"pins = {shown(settings.pins)}: give `wheelwire.Pins`")
        if store is not None:
            settings = replace(settings, store=str(converted_store(path("store", store))))
        self._limits: tuple[str, ...] = ()

        def open_transport(_baud_rate: int) -> Transport:
            transport = launch(settings)
            limits.append(transport.limits)
            return transport

        limits: list[tuple[str, ...]] = []
        super().__init__(settings.backend, open_transport)
        self._limits = limits[0]
        for limit in self._limits:
            log.warning("%s: %s", settings.backend, limit)

    @property
    def limits(self) -> tuple[str, ...]:
        """What this wiring cannot do, in sentences; logged once as warnings."""
        return self._limits
