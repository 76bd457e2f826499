"""Waiting for a condition in real time."""

from __future__ import annotations

import time
from collections.abc import Callable

from wheelwire.drivers.driving import Driving
from wheelwire.errors import LinkLost

PERIOD_S = 0.002


def is_open(robot: Driving) -> bool:
    """Whether the driver can reach its robot."""
    try:
        robot.geometry  # noqa: B018
    except LinkLost:
        return False
    return True


def wait_until(
    condition: Callable[[], object], timeout_s: float = 10.0, what: str = "the condition"
) -> None:
    """Return as soon as `condition()` holds; fail when it does not in time."""
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, f"{what} never held"
        time.sleep(PERIOD_S)
