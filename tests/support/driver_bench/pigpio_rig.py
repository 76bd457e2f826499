"""pigpio: the daemon's stand-in turns the encoders; its own process, as the daemon is."""

from __future__ import annotations

import time

from support.driver_bench.rig import Rig
from support.pigpio_process import PigpioProcess
from wheelwire.drivers.pigpio import PigpioDriver


class PigpioRig(Rig):
    """Runs from `with` to the end of its block."""

    name = "pigpio"

    def __enter__(self) -> PigpioRig:
        self._daemon = PigpioProcess()
        self.driver = PigpioDriver(
            "127.0.0.1", self._daemon.port, parameters={"overrun_limit_us": 1e6}
        )
        self._command("spin 0")
        return self

    def __exit__(self, *_: object) -> None:
        self.driver.shutdown()
        self._daemon.close()

    def spin(self, ticks_per_s: float, seconds: float) -> tuple[int, float]:
        before, start = self._command(f"spin {ticks_per_s}"), time.monotonic()
        time.sleep(seconds)
        self._command("spin 0")
        elapsed = time.monotonic() - start
        return self._rest() - before, elapsed

    def en_low_us(self) -> int:
        return int(self._daemon.command("truth")["driven_changed_us"])

    def _rest(self) -> int:
        """The true ticks, once the source has stopped making more."""
        ticks = self._command("truth")
        while True:
            time.sleep(0.05)
            now = self._command("truth")
            if now == ticks:
                return ticks
            ticks = now

    def _command(self, line: str) -> int:
        return sum(self._daemon.command(line)["ticks"])
