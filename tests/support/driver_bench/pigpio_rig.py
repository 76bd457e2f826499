"""pigpio: the real client library, and a stand-in for the daemon."""

from __future__ import annotations

from support.driver_bench.stand_in_rig import StandInRig
from support.pigpio_process import PigpioProcess
from wheelwire.drivers.pigpio import PigpioDriver


class PigpioRig(StandInRig):
    """Runs from `with` to the end of its block."""

    name = "pigpio"

    def __enter__(self) -> PigpioRig:
        self.stand_in = daemon = PigpioProcess()
        self.driver = PigpioDriver(
            "127.0.0.1", daemon.port, parameters={"overrun_limit_us": 1e6}, core_timeout_ms=5000
        )
        self._command("spin 0")
        return self
