"""The rate and the loss of the last second."""

from __future__ import annotations

import pytest

from wheelwire.link.info import RecentCounts


def test_rate_and_loss_are_those_of_the_last_second() -> None:
    counts = RecentCounts()
    assert counts.rate_and_loss(0, 0, 0, 0) == (0.0, 0.0)
    for tenth in range(51):  # 100 states a second, and from the fourth second on none is lost
        lost = min(10 * tenth, 300)
        counts.note(tenth * 100_000, 10 * tenth, 10 * tenth, lost)
        if tenth == 30:
            rate_hz, loss = counts.rate_and_loss(3_000_000, 300, 300, 300)
            assert rate_hz == pytest.approx(100)
            assert loss == pytest.approx(0.5)
    rate_hz, loss = counts.rate_and_loss(5_000_000, 500, 500, 300)
    assert rate_hz == pytest.approx(100)
    assert loss == 0.0


def test_a_frame_that_came_late_is_no_negative_loss() -> None:
    counts = RecentCounts()
    counts.note(0, 0, 0, 3)
    assert counts.rate_and_loss(500_000, 50, 53, 2) == (100.0, 0.0)
