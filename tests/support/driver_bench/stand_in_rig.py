"""Base of the rigs whose encoders are turned by a stand-in process."""

from __future__ import annotations

import time

from support.driver_bench.rig import Rig, Timing
from support.stand_in import StandIn


class StandInRig(Rig):
    """A driver on a stand-in."""

    stand_in: StandIn

    def __exit__(self, *_: object) -> None:
        self.driver.shutdown()
        self.stand_in.close()

    def time_stops(self) -> Timing:
        self.stand_in.set_realtime()
        try:
            return super().time_stops()
        finally:
            self.stand_in.set_realtime(False)

    def spin(self, ticks_per_s: float, seconds: float) -> tuple[int, float]:
        before, start = self._command(f"spin {ticks_per_s}"), time.monotonic()
        time.sleep(seconds)
        self._command("spin 0")
        elapsed = time.monotonic() - start
        return self._rest() - before, elapsed

    def en_low_us(self) -> int:
        return int(self.stand_in.truth()["driven_changed_us"])

    def _rest(self) -> int:
        """The true ticks, after the source has stopped."""
        ticks = self._command("truth")
        while True:
            time.sleep(0.05)
            now = self._command("truth")
            if now == ticks:
                return ticks
            ticks = now

    def _command(self, line: str) -> int:
        return sum(self.stand_in.command(line)["ticks"])
