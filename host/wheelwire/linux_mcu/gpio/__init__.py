"""Ways to reach this computer's pins: the pin libraries are imported when they are used."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

from ..settings import McuSettings
from .base import Gpio, PinsBusy

BUSY_S = 6.0
"""A former process brakes for 5 s at most before it lets its pins go."""
RETRY_S = 0.05


def open_gpio(settings: McuSettings, parameters: dict[str, float]) -> Gpio:
    """Claim the pins; waits while a process that is ending still has them.

    Args:
        settings: Which pins, and through what.
        parameters: Values in force at the start: PWM frequency and glitch filter are used.

    Raises:
        DriverUnavailable: A library is missing, or a pin or its PWM cannot be had.
        ConfigurationError: The pins do not fit.
    """
    end = time.monotonic() + BUSY_S
    while time.monotonic() < end:
        with suppress(PinsBusy):
            return _open(settings, parameters)
        time.sleep(RETRY_S)
    return _open(settings, parameters)


def _open(settings: McuSettings, parameters: dict[str, float]) -> Gpio:
    if settings.backend == "pigpio":
        from .pigpiod import PigpiodGpio

        return PigpiodGpio(settings, parameters)
    from .library import LibraryGpio

    return LibraryGpio(settings, parameters)


def prepare_enable_low(settings: McuSettings) -> Callable[[], None]:
    """For the guard: all that is slow is done now; a call then claims EN and pulls it low."""
    if settings.backend == "pigpio":
        return _leave_to_the_daemon
    from .library import EnableLow

    return EnableLow(settings)


def _leave_to_the_daemon() -> None:
    """A script inside pigpiod pulls EN low once the core lets it wait."""
