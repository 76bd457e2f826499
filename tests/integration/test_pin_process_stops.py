"""Whatever happens to an application or to the process that moves the pins, the wheels stop.

`bench/process_failures.py` measures the times. The limits here are for a busy test machine. Who it
is that stops them on a computer's own pins, and how soon: `test_who_stops.py`.
"""

import pytest

from support.process_failures import (
    APPLICATION_FAILURES,
    LONG_TTL_S,
    TTL_S,
    UNDETECTED_FAILURES,
    time_failure,
)

CORE_TIMEOUT_MS = 2000
LATE_US = 1_000_000
BUSY_US = 2_000_000
BRAKE_US = 1_000_000


@pytest.mark.parametrize(
    ("driver", "failure"),
    [
        *(("l298n, software PWM", failure) for failure in APPLICATION_FAILURES),
        ("mock", "killed (SIGKILL)"),
    ],
)
def test_an_application_that_dies_stops_its_robot(driver: str, failure: str) -> None:
    undetected = failure in UNDETECTED_FAILURES
    times = time_failure(
        driver,
        failure,
        core_timeout_ms=None if driver == "mock" else CORE_TIMEOUT_MS,
        ttl_s=TTL_S if undetected else LONG_TTL_S,
    )
    if undetected:
        assert times.late_us < LATE_US
        assert times.ended_us is None
    else:
        # The deadline is far away: the end of the application was noticed.
        assert times.failure_to_removed_us < BUSY_US < LONG_TTL_S * 1e6
        assert times.ended_us is not None
        assert times.ended_us < BRAKE_US + BUSY_US
