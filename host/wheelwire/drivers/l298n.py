"""The driver of a robot whose L298N and encoders are wired to this Raspberry Pi's own pins."""

from __future__ import annotations

from .options import takes
from .pin_options import L298NOptions
from .pins import PinDriver


class L298NDriver(PinDriver):
    """A robot on this computer's pins, through gpiozero's pin factory.

    Args:
        pins: The wiring; by default that of the guide for a Raspberry Pi 4B and an L298N.
        pwm_chip: Number of the kernel's PWM chip, where there are several.
        tap: See `SerialDriver`.
        parameters: Values that differ from the defaults, by name.
        store: File for parameters saved at run time.
        pwm_directory: Where the kernel's PWM is.
        core_timeout_ms: If the core is silent for longer while it holds the pins, it is killed
            and EN is pulled low.

    Raises:
        DriverUnavailable: gpiozero or the core's library is not installed, or a pin or its PWM is
            not available.
        ConfigurationError: The pins or the store do not fit.
    """

    @takes(L298NOptions)
    def __init__(self, options: L298NOptions) -> None:
        super().__init__(options.checked(), tap=options.tap)
