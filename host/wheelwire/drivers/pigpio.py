"""The driver of a robot wired to a Raspberry Pi whose pins pigpiod holds, here or elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..arguments import text, whole
from ..board import BoardDescription
from ..linux_mcu.settings import PIGPIO_CORE_TIMEOUT_MS, McuSettings
from ..parameters import checked_values
from .pins import PinDriver, PinProcess, checked_pins

DEFAULT_PORT = 8888


class PigpioDriver(PinDriver):
    """A robot behind a pigpio daemon.

    Args:
        host: Where the daemon runs.
        port: Its TCP port.
        pins: The wiring; by default that of the guide for a Raspberry Pi 4B and an L298N.
        parameters: Values that differ from the defaults, by name.
        store: A file that keeps parameters which are saved at run time.
        core_timeout_ms: If the core is silent for longer, it is killed; the script inside pigpiod
            then pulls EN low.

    Raises:
        DriverUnavailable: pigpio's client or the core's library is not installed, no daemon
            answers, or it refuses.
        ConfigurationError: The pins or the store do not fit.
    """

    def __init__(
        self,
        host: str = "localhost",
        port: int = DEFAULT_PORT,
        *,
        pins: BoardDescription | None = None,
        parameters: Mapping[str, float] | None = None,
        store: Path | None = None,
        core_timeout_ms: int = PIGPIO_CORE_TIMEOUT_MS,
    ) -> None:
        super().__init__(
            pigpio_process(
                host,
                port,
                pins=pins,
                parameters=parameters,
                store=store,
                core_timeout_ms=core_timeout_ms,
            )
        )


def pigpio_process(
    host: str = "localhost",
    port: int = DEFAULT_PORT,
    *,
    pins: BoardDescription | None = None,
    parameters: Mapping[str, float] | None = None,
    store: Path | None = None,
    core_timeout_ms: int = PIGPIO_CORE_TIMEOUT_MS,
) -> PinProcess:
    """The process of a driver with these arguments, checked."""
    settings = McuSettings(
        backend="pigpio",
        board=checked_pins(pins),
        parameters=checked_values(parameters),
        host=text("host", host, "localhost"),
        port=whole("port", port, 1, 65_535),
        core_timeout_ms=core_timeout_ms,
    )
    return PinProcess(settings, store)
