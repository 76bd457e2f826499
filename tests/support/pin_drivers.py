"""The drivers of a computer's own pins, on stand-ins for what moves them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

from wheelwire.drivers.l298n import L298NDriver
from wheelwire.drivers.pigpio import PigpioDriver

from .gpio_chip_process import GpioChip
from .pigpio_process import PigpioProcess

PATIENT: dict[str, Any] = {
    "parameters": {"overrun_limit_us": 1e6, "ttl_max_s": 5},
    "core_timeout_ms": 5000,
}
"""A busy computer must not cause a fault."""


@contextmanager
def l298n_on(chip: GpioChip, **options: Any) -> Iterator[L298NDriver]:
    """`l298n`; for its processes the chip is this computer's."""
    with (
        mock.patch.dict("os.environ", chip.environment),
        L298NDriver(pwm_directory=chip.pwm_directory, **PATIENT | options) as driver,
    ):
        yield driver


@contextmanager
def pigpio_on(daemon: PigpioProcess, **options: Any) -> Iterator[PigpioDriver]:
    """`pigpio`."""
    with PigpioDriver("127.0.0.1", daemon.port, **PATIENT | options) as driver:
        yield driver
