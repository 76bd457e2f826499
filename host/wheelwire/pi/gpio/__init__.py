"""Access to this computer's pins. A pin library is imported only when it is used."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module

from ..settings import McuSettings
from .base import Gpio, PinsBusy

BUSY_TIMEOUT_S = 6.0
"""A previous process brakes for at most 5 s before it releases its pins."""
RETRY_S = 0.05


def open_gpio(settings: McuSettings, parameters: dict[str, float]) -> Gpio:
    """Claim the pins; waits while a process that is ending still holds them.

    Args:
        settings: The pins and the backend.
        parameters: Parameters at the start; PWM frequency and glitch filter are used.

    Raises:
        DriverUnavailable: A library is missing, or a pin or its PWM cannot be claimed.
        ConfigurationError: The pins are invalid.
    """
    end = time.monotonic() + BUSY_TIMEOUT_S
    while time.monotonic() < end:
        with suppress(PinsBusy):
            return _open(settings, parameters)
        time.sleep(RETRY_S)
    # The last attempt: its PinsBusy is raised.
    return _open(settings, parameters)


def _open(settings: McuSettings, parameters: dict[str, float]) -> Gpio:
    if settings.backend == "pigpio":
        from .pigpiod import PigpiodGpio

        return PigpiodGpio(settings, parameters)
    from .gpiozero import LibraryGpio

    return LibraryGpio(settings, parameters)


def import_library(settings: McuSettings) -> None:
    """Before the fork: core and guard need it, and it is slow to import. It starts no threads."""
    if settings.backend == "l298n":
        with suppress(ImportError):  # the core runs into it again, and reports it
            import_module("gpiozero")


def prepare_enable_low(settings: McuSettings) -> Callable[[], None]:
    """Do the slow part for the guard; the returned function claims EN and pulls it low."""
    if settings.backend == "pigpio":
        return _rely_on_watchdog
    from .gpiozero import EnableLow

    return EnableLow(settings)


def _rely_on_watchdog() -> None:
    """Nothing to do: a script inside pigpiod pulls EN low when the core stops refreshing it."""
