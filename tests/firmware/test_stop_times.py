"""The drive is removed within one control period of the deadline, whatever happens to the link.

A few runs of what `make reliability` measures.
"""

from __future__ import annotations

import pytest

from support.stop_times import FAILURES, PERIOD_US, TTL_S, stop_time

LONGEST_US = TTL_S * 1e6 + 2 * PERIOD_US


@pytest.mark.parametrize("name", FAILURES)
@pytest.mark.parametrize("seed", range(5))
def test_the_drive_is_removed_in_time(name: str, seed: int) -> None:
    time = stop_time(FAILURES[name], seed)
    if time.late_us is None:
        assert time.failure_to_removed_us == 0
    else:
        assert 0 <= time.late_us <= PERIOD_US
        assert time.failure_to_removed_us <= LONGEST_US
    assert 0 < time.removed_to_standstill_us < 1_000_000
    assert time.distance_m < 0.2
