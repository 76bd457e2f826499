"""The driver of a robot whose L298N and encoders are wired to this Raspberry Pi's own pins."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..arguments import path, whole
from ..board import BoardDescription
from ..linux_mcu.settings import CORE_TIMEOUT_MS, McuSettings
from ..parameters import checked_values
from .pins import PinDriver, PinProcess, checked_pins

PWM_DIRECTORY = Path("/sys/class/pwm")
MAX_CHIP = 255


class L298NDriver(PinDriver):
    """A robot on this computer's pins, through gpiozero's pin factory.

    Args:
        pins: The wiring; by default that of the guide for a Raspberry Pi 4B and an L298N.
        pwm_chip: Number of the kernel's PWM chip, where there are several.
        parameters: Values that differ from the defaults, by name.
        store: A file that keeps parameters which are saved at run time.
        pwm_directory: Where the kernel's PWM is.
        core_timeout_ms: If the core is silent for longer while it holds the pins, it is killed
            and EN is pulled low.

    Raises:
        DriverUnavailable: gpiozero or the core's library is not installed, or a pin or its PWM
            cannot be had.
        ConfigurationError: The pins or the store do not fit.
    """

    def __init__(
        self,
        *,
        pins: BoardDescription | None = None,
        pwm_chip: int | None = None,
        parameters: Mapping[str, float] | None = None,
        store: Path | None = None,
        pwm_directory: Path = PWM_DIRECTORY,
        core_timeout_ms: int = CORE_TIMEOUT_MS,
    ) -> None:
        super().__init__(
            l298n_process(
                pins=pins,
                pwm_chip=pwm_chip,
                parameters=parameters,
                store=store,
                pwm_directory=pwm_directory,
                core_timeout_ms=core_timeout_ms,
            )
        )


def l298n_process(
    *,
    pins: BoardDescription | None = None,
    pwm_chip: int | None = None,
    parameters: Mapping[str, float] | None = None,
    store: Path | None = None,
    pwm_directory: Path = PWM_DIRECTORY,
    core_timeout_ms: int = CORE_TIMEOUT_MS,
) -> PinProcess:
    """The process of a driver with these arguments, checked."""
    settings = McuSettings(
        backend="l298n",
        board=checked_pins(pins),
        parameters=checked_values(parameters),
        pwm_directory=str(path("pwm_directory", pwm_directory)),
        pwm_chip=None if pwm_chip is None else whole("pwm_chip", pwm_chip, 0, MAX_CHIP),
        core_timeout_ms=core_timeout_ms,
    )
    return PinProcess(settings, store)
