"""Tests in real time, on a computer that may give a process no time for a second."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import TypeVar, cast

import pytest

from wheelwire.errors import WheelwireError

Test = TypeVar("Test", bound=Callable[..., None])

RUNS = 3
REPORTS = (
    "no sample came within",
    "no answer to ",
    "are left of the setpoint's ttl",
)
"""What the library says when its own process, or the device's, got no time for 0.3 s to 1 s."""


def again_after_a_stall(test: Test) -> Test:
    """Run a test again when it ended with one of these reports, which are then the right answer.

    The wheels have stopped, and the program knows; what the test is about was not reached. A
    robot that never answers, or refuses every setpoint, fails in each run.
    """

    @functools.wraps(test)
    def run(*args: object, **kwargs: object) -> None:
        for runs_left in reversed(range(RUNS)):
            try:
                test(*args, **kwargs)
            except (AssertionError, WheelwireError, pytest.fail.Exception) as error:  # noqa: PERF203
                stalled = any(report in str(error) for report in REPORTS)
                if not (runs_left and stalled):
                    raise
            else:
                return

    return cast("Test", run)
