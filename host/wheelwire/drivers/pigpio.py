"""The driver of a robot wired to a Raspberry Pi whose pins pigpiod holds, here or elsewhere."""

from __future__ import annotations

from .options import takes
from .pin_options import PigpioDriverOptions
from .pins import PinDriver


class PigpioDriver(PinDriver):
    """A robot behind a pigpio daemon.

    Args:
        host: Where the daemon runs.
        port: Its TCP port.
        tap: See `SerialDriver`.
        pins: The wiring; by default that of the guide for a Raspberry Pi 4B and an L298N.
        parameters: Values that differ from the defaults, by name.
        store: File for parameters saved at run time.
        core_timeout_ms: If the core is silent for longer, it is killed; the script inside pigpiod
            then pulls EN low.

    Raises:
        DriverUnavailable: pigpio's client or the core's library is not installed, no daemon
            answers, or it refuses.
        ConfigurationError: The pins or the store do not fit.
    """

    @takes(PigpioDriverOptions)
    def __init__(self, options: PigpioDriverOptions) -> None:
        super().__init__(options.checked(), tap=options.tap)
