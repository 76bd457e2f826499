"""Whatever happens to an application or to the process that moves the pins, the wheels stop.

`bench/process_failures.py` measures the times. The limits here are for a busy test machine.
"""

import itertools

import pytest

from support.process_failures import (
    APPLICATION_FAILURES,
    CORE_FAILURES,
    UNDETECTED_FAILURES,
    time_failure,
)

CORE_TIMEOUT_MS = 2000
SHORT_CORE_TIMEOUT_MS = 500
"""Longer than the default: a core that waits for a busy test machine is not hung."""
LATE_US = 1_000_000
BUSY_US = 2_000_000
BRAKE_US = 1_000_000


@pytest.mark.parametrize(
    ("driver", "failure"),
    list(itertools.product(["l298n, software PWM", "mock"], APPLICATION_FAILURES)),
)
def test_an_application_that_dies_stops_its_robot(driver: str, failure: str) -> None:
    times = time_failure(
        driver, failure, core_timeout_ms=None if driver == "mock" else CORE_TIMEOUT_MS
    )
    assert times.late_us < LATE_US
    if failure in UNDETECTED_FAILURES:
        assert times.ended_us is None
    else:
        assert times.ended_us is not None
        assert times.ended_us < BRAKE_US + BUSY_US


@pytest.mark.parametrize(
    ("driver", "failure"),
    [
        *itertools.product(["l298n", "l298n, software PWM"], CORE_FAILURES),
        ("pigpio", "core killed"),
        ("pigpio", "killed (SIGKILL)"),
        ("pigpio", "stopped (SIGSTOP)"),
    ],
)
def test_a_core_that_dies_leaves_the_bridge_off(driver: str, failure: str) -> None:
    assert (
        time_failure(driver, failure, core_timeout_ms=SHORT_CORE_TIMEOUT_MS).failure_to_removed_us
        < BUSY_US
    )
