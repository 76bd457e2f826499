"""The options of the drivers of this computer's own pins; see `options`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..arguments import path, text, whole
from ..board import Configuration
from ..errors import ConfigurationError, InvalidArgument, shown
from ..parameters import checked_values
from ..pi.pins import Pins
from ..pi.settings import CORE_TIMEOUT_MS, PIGPIO_CORE_TIMEOUT_MS, McuSettings

MAX_CORE_TIMEOUT_MS = 60_000
MAX_CHIP = 255
LOCAL_HOSTS = ("localhost", "127.0.0.1", "::1")
PWM_DIRECTORY = Path("/sys/class/pwm")


@dataclass(frozen=True, kw_only=True)
class PinOptions:
    """The options of both drivers of this computer's own pins; see `L298NDriver`."""

    pins: Configuration | None = None
    parameters: Mapping[str, float] | None = None
    store: Path | None = None
    core_timeout_ms: int = CORE_TIMEOUT_MS

    def _common(self) -> dict[str, Any]:
        """The settings of the process that are the same for both drivers, checked."""
        if self.pins is not None and not isinstance(self.pins, Configuration):
            raise InvalidArgument(
                f"pins = {shown(self.pins)}: give `wheelwire.Pins(...)`, or another board"
            )
        store = None if self.store is None else path("store", self.store)
        timeout_ms = whole("core_timeout_ms", self.core_timeout_ms, 1, MAX_CORE_TIMEOUT_MS)
        return {
            "board": self.pins or Pins(),
            "parameters": checked_values(self.parameters),
            "store": None if store is None else str(store.absolute()),
            "core_timeout_ms": timeout_ms,
        }


@dataclass(frozen=True, kw_only=True)
class GpioOptions:
    """The section `gpio` of a robot's file."""

    pwm_chip: int | None = None
    tap: bool = True


@dataclass(frozen=True, kw_only=True)
class L298NOptions(PinOptions, GpioOptions):
    """The options of `L298NDriver`."""

    pwm_directory: Path = PWM_DIRECTORY

    def checked(self) -> McuSettings:
        """The process that moves the pins, with these options, checked."""
        chip = self.pwm_chip
        return McuSettings(
            "l298n",
            **self._common(),
            pwm_directory=str(path("pwm_directory", self.pwm_directory)),
            pwm_chip=None if chip is None else whole("pwm_chip", chip, 0, MAX_CHIP),
        )


@dataclass(frozen=True)
class PigpioOptions:
    """The section `pigpio` of a robot's file."""

    host: str = "localhost"
    port: int = 8888
    tap: bool = field(default=True, kw_only=True)


@dataclass(frozen=True)
class PigpioDriverOptions(PinOptions, PigpioOptions):
    """The options of `PigpioDriver`."""

    core_timeout_ms: int = field(default=PIGPIO_CORE_TIMEOUT_MS, kw_only=True)

    def checked(self) -> McuSettings:
        """The process that moves the pins, with these options, checked."""
        settings = McuSettings(
            "pigpio",
            **self._common(),
            host=text("host", self.host, "localhost"),
            port=whole("port", self.port, 1, 65_535),
        )
        if settings.buses and settings.host not in LOCAL_HOSTS:
            raise ConfigurationError(
                f"pigpio.host = {settings.host!r}: the pins are there, but the I2C bus would be "
                "this computer's: run the program there, or leave imu and power out"
            )
        return settings
