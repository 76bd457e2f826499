"""Samples and ticks: complete, in order, each once, without a jump."""

from __future__ import annotations

from itertools import pairwise

import pytest

from .bench import Bench
from .harness import SPEED_MPS, DriveHarness

BATCH_S = 0.05
"""Some drivers receive edges in batches, and late on a busy machine."""


class SamplingTests:
    """Samples and ticks."""

    def test_a_sample_is_read_once_and_in_order(self, harness: DriveHarness) -> None:
        times = [harness.next().t_us for _ in range(20)]
        assert times == sorted(set(times))

    def test_ticks_continue_without_a_jump(self, harness: DriveHarness) -> None:
        samples = harness.drive(SPEED_MPS, 0.0, 1.0)
        per_metre = 1 / harness.driver.geometry.metres_per_tick
        for before, after in pairwise(samples):
            travel = after.since(before)
            assert not travel.rebased
            most = 3 * SPEED_MPS * per_metre * (travel.dt_s + BATCH_S)
            # A wheel that starts from an edge may toggle before it goes on.
            assert -2 <= travel.left <= most
            assert -2 <= travel.right <= most

    def test_no_tick_is_lost(self, bench: Bench, harness: DriveHarness) -> None:
        start, true_start = harness.driver.get_encoder_ticks(), bench.true_ticks()
        harness.drive(SPEED_MPS, 1.0, 1.0)
        harness.drive(-SPEED_MPS, 0.0, 1.0)
        harness.rest()
        harness.watch(0.2)  # let the last edges arrive
        end, true_end = harness.driver.get_encoder_ticks(), bench.true_ticks()
        assert end[0] - start[0] == true_end[0] - true_start[0]
        assert end[1] - start[1] == true_end[1] - true_start[1]

    def test_a_stamp_is_the_hosts_time(self, harness: DriveHarness) -> None:
        samples = harness.watch(1.0)
        elapsed_s = samples[-1].stamp - samples[0].stamp
        assert elapsed_s == pytest.approx(samples[-1].since(samples[0]).dt_s, abs=0.05)
