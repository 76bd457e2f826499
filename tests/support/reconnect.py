"""The time that a link takes to reconnect, in real time."""

from __future__ import annotations

import time
from pathlib import Path

from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator

AIM_S = 0.25
"""Target for the p99, from the port's return."""
TIMEOUT_S = 30.0


def after_unplug(simulator: Simulator, robot: SerialDriver, name: Path | None = None) -> float:
    """Seconds from the port's return to a sample that was latched after it.

    With a name the port that was at `robot.info.port` comes back under it.
    """
    old = Path(robot.info.port)
    simulator.unplug()
    if name is not None:
        old.unlink()
    wait_until(lambda: not robot.is_open, what="the loss of the port")
    simulator.plug()
    if name is not None:
        name.symlink_to(simulator.port)
    since = time.monotonic()
    while robot.read(TIMEOUT_S).stamp < since:
        assert time.monotonic() < since + TIMEOUT_S, "no fresh sample"
    return time.monotonic() - since


def after_reset(simulator: Simulator, robot: SerialDriver) -> float:
    """Seconds from a reset to a sample of the new boot; includes the boot's own time."""
    begin = time.monotonic()
    boot_id = simulator.reset()
    while robot.read(TIMEOUT_S).boot_id != boot_id:
        assert time.monotonic() < begin + TIMEOUT_S, "no sample of the new boot"
    return time.monotonic() - begin
