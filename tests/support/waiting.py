"""Waiting for a condition in real time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import TypeVar

from wheelwire.robot.robot import Robot

PERIOD_S = 0.002
TIMEOUT_S = 90.0
"""Even a process that starts on a computer with much else to do."""
RUNS = 4

T = TypeVar("T")


def keep_driving(robot: Robot) -> None:
    """Drive for half a second, even if the chip has just restarted."""
    robot.set_velocity(0.0, 0.0)
    for _ in range(50):
        robot.set_velocity(0.1, 0.0)
        robot.read()


def stop_and_stand(robot: Robot) -> None:
    """Stop, and wait until the wheels stand: some parameters change only then."""
    robot.stop()
    stopped = time.monotonic()

    def stands() -> bool:
        sample = robot.read()
        return sample.stamp > stopped and sample.left_mps == sample.right_mps == 0

    wait_until(stands, what="standing")


def wait_until(
    condition: Callable[[], T | None], timeout_s: float = TIMEOUT_S, what: str = "the condition"
) -> T:
    """Return what `condition()` returns as soon as it holds; fail when it does not in time."""
    end = time.monotonic() + timeout_s
    while not (found := condition()):
        assert time.monotonic() < end, f"{what} never held"
        time.sleep(PERIOD_S)
    return found


def undisturbed(run: Callable[[], T], is_undisturbed: Callable[[T], bool]) -> T:
    """Repeat a run that a stalled computer has spoilt; a fault spoils them all."""
    for _ in range(RUNS - 1):
        result = run()
        if is_undisturbed(result):
            return result
    return run()


async def until(condition: Callable[[], object]) -> None:
    """As `wait_until`, in a loop."""
    end = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < end, "the condition never held"
        await asyncio.sleep(PERIOD_S)
