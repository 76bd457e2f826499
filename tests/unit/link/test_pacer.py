"""Samples are thinned by the clock that made them."""

from __future__ import annotations

import pytest

from wheelwire.link.sample_stream import Pacer


def published(pacer: Pacer, times_us: list[int], boot_id: int = 1) -> list[int]:
    return [t for t in times_us if pacer.is_due(t, boot_id)]


def test_four_times_the_rate_is_thinned_evenly() -> None:
    times = published(Pacer(50), list(range(0, 1_000_000, 5_000)))
    assert times == list(range(0, 1_000_000, 20_000))


@pytest.mark.parametrize("jitter_us", [-900, 0, 900])
def test_the_rate_itself_passes_whole_though_it_jitters(jitter_us: int) -> None:
    times = [n * 20_000 + (jitter_us if n % 2 else 0) for n in range(100)]
    assert published(Pacer(50), times) == times


def test_a_gap_is_followed_by_no_burst() -> None:
    times = [0, 5_000, *range(2_000_000, 2_100_000, 5_000)]
    assert published(Pacer(50), times) == [0, *range(2_000_000, 2_100_000, 20_000)]


def test_a_restarted_device_is_heard_at_once() -> None:
    pacer = Pacer(50)
    published(pacer, [0, 90_000_000])
    assert published(pacer, [100, 5_100, 20_100], boot_id=2) == [100, 20_100]
