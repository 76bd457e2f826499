"""A script inside pigpiod that stops the wheels unless this program keeps refreshing it.

The daemon leaves its pins unchanged when a client dies or the network fails. The script counts
down; the running control loop resets its counter; at zero it pulls EN low and ends. It also shows
other programs that these pins are in use.
"""

from __future__ import annotations

import time
from contextlib import suppress

from .base import PinsBusy
from .pigpio_client import PigpioClient

CHECK_MS = 10
CHECKS = 11
"""The pins go low one check after these many have counted down to zero: 0.11 to 0.12 s after the
last refresh."""
REFRESH_US = 20_000
SCRIPT_MARK = 0x57574C01
"""Mark in the last parameter of a script, by which Wheelwire recognises its scripts."""
MAX_SCRIPTS = 32
FIRST_START_S = 1.0


class PigpioWatchdog:
    """The running script; `close` removes it.

    Args:
        client: An open connection.
        pins: The GPIOs that hold the motors off when they are low: at most 8.

    Raises:
        PinsBusy: Another program drives these pins.
    """

    def __init__(self, client: PigpioClient, pins: tuple[int, ...]) -> None:
        self._client = client
        self._library = client.library
        # Sorted, so that `_claim` recognises a script for the same pins.
        self._pins = sorted(pins)
        # The ten that a script has: the counter, up to eight pins, the mark.
        self._parameters = [CHECKS, *self._pins, *[0] * (8 - len(pins)), SCRIPT_MARK]
        self._next_us = 0
        self._claim()
        writes = " ".join(f"w {gpio} 0" for gpio in pins)
        # Each round: wait CHECK_MS, decrement p0, repeat while it is not negative (`jp` also jumps
        # at zero); then all low.
        script = f"tag 0 mils {CHECK_MS} dcr p0 jp 0 {writes} halt"
        self._id: int = client.call("store_script", script.encode())
        self._run()

    def keep_alive(self, now_us: int) -> bool:
        """Refresh the script from time to time. False if it had ended: EN is low then."""
        if now_us < self._next_us:
            return True
        self._next_us = now_us + REFRESH_US
        status, _ = self._status(self._id)
        # New parameters do not start a script that has ended: it is run again.
        if status != self._library.PI_SCRIPT_RUNNING:
            self._run()
            return False
        self._client.call("update_script", self._id, self._parameters)
        return True

    def close(self) -> None:
        """Stop and delete the script."""
        self._client.call("stop_script", self._id)
        self._client.call("delete_script", self._id)

    def _run(self) -> None:
        # A script that was just stored is still being set up, and cannot be run before.
        self._wait_while(self._id, self._library.PI_SCRIPT_INITING, FIRST_START_S)
        self._client.call("run_script", self._id, self._parameters)

    def _claim(self) -> None:
        """Delete the script of a killed program; refuse if a running program refreshes it."""
        for script_id in range(MAX_SCRIPTS):
            _, parameters = self._status(script_id)
            if not parameters or parameters[1:] != tuple(self._parameters[1:]):
                continue
            # A script that nobody refreshes ends within its countdown: one that still runs after
            # twice that time has a program behind it.
            longest_s = 2 * CHECKS * CHECK_MS / 1000
            running = self._library.PI_SCRIPT_RUNNING
            if not self._wait_while(script_id, running, longest_s):
                gpios = " and ".join(map(str, self._pins))
                raise PinsBusy(
                    f"another program drives GPIO {gpios} through the pigpiod at "
                    f"{self._client.address}: end it first"
                )
            # Its owner may have deleted it meanwhile.
            with suppress(self._library.error):
                self._client.call("delete_script", script_id)

    def _wait_while(self, script_id: int, status: int, longest_s: float) -> bool:
        end = time.monotonic() + longest_s
        while self._status(script_id)[0] == status:
            if time.monotonic() > end:
                return False
            time.sleep(0.005)
        return True

    def _status(self, script_id: int) -> tuple[int, tuple[int, ...]]:
        status, parameters = self._client.call("script_status", script_id)
        return status, tuple(parameters)
