"""A Raspberry Pi's GPIO chip, and perhaps its PWM directory, for programs that use gpiozero."""

from __future__ import annotations

import os
from pathlib import Path

from support.gpio_chip.chip import SOCKET
from support.stand_in import TESTS, StandIn
from wheelwire.board import Configuration
from wheelwire.pi.pins import Pins

SITE = TESTS / "support" / "gpio_chip" / "site"


class GpioChip(StandIn):
    """Runs from `with` to the end of its block.

    Args:
        directory: An empty directory.
        kernel_pwm: Whether to create `pwm` in it, like /sys/class/pwm.
        board: What is connected to its pins.
    """

    def __init__(
        self, directory: Path, kernel_pwm: bool = True, board: Configuration | None = None
    ) -> None:
        self.pwm_directory = directory / "pwm"
        path = directory / "chip"
        arguments = [(board or Pins()).packed().hex()]
        arguments += [str(self.pwm_directory)] if kernel_pwm else []
        super().__init__("support.gpio_chip", str(path), *arguments)
        python_path = [str(TESTS), str(SITE), os.environ.get("PYTHONPATH", "")]
        self.environment = {
            "GPIOZERO_PIN_FACTORY": "chip",
            SOCKET: str(path),
            "PYTHONPATH": os.pathsep.join(filter(None, python_path)),
        }
        """The environment of processes that are to use this chip."""
