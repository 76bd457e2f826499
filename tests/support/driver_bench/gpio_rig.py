"""l298n: gpiozero's mock pins on a stand-in for the GPIO chip, its edges through a socket."""

from __future__ import annotations

import tempfile
from pathlib import Path
from unittest import mock

from support.driver_bench.stand_in_rig import StandInRig
from support.gpio_chip_process import GpioChip
from wheelwire.drivers.l298n import L298NDriver


class GpioRig(StandInRig):
    """Runs from `with` to the end of its block."""

    name = "l298n"

    def __enter__(self) -> GpioRig:
        self._directory = tempfile.TemporaryDirectory()
        self.stand_in = chip = GpioChip(Path(self._directory.name))
        with mock.patch.dict("os.environ", chip.environment):
            self.driver = L298NDriver(
                parameters={"overrun_limit_us": 1e6},
                pwm_directory=chip.pwm_directory,
                core_timeout_ms=5000,
            )
        self._command("spin 0")
        return self

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self._directory.cleanup()
