import pytest

from support.clocks import (
    GAP_US,
    LONG_DELAYS,
    PROBES,
    SHORT_DELAYS,
    USB,
    Clocks,
    Coverage,
    LineDelays,
    session,
)
from wheelwire.link.clock import ClockEstimator, Exchange


@pytest.mark.parametrize("drift_ppm", [-200, -20, 0, 50, 200])
def test_the_bound_covers_the_error(drift_ppm: float) -> None:
    coverages = [Coverage() for _ in range(4)]
    settled = slice(65 * PROBES, None)
    for seed, coverage in enumerate(coverages):
        session(coverage, Clocks(seed, drift_ppm * 1e-6))
        assert max(coverage.bounds_us[settled]) < 2_500
    checked = sum(len(coverage.errors_us) for coverage in coverages)
    assert checked == 8000
    assert sum(coverage.missed for coverage in coverages) <= checked // 1000
    errors_us = sorted(error for coverage in coverages for error in coverage.errors_us[settled])
    assert errors_us[len(errors_us) // 2] < 500  # half the difference of the two ways is 350


@pytest.mark.parametrize("ways", [SHORT_DELAYS, USB, LONG_DELAYS])
@pytest.mark.parametrize("steps", [0, 4])
def test_the_bound_is_honest_over_steps_and_delays(ways: LineDelays, steps: int) -> None:
    coverage = Coverage()
    for seed in range(4):
        session(coverage, Clocks(seed, 200e-6, ways), step_us=100_000, steps=steps)
    assert coverage.share >= 0.999


@pytest.mark.parametrize("period_us", [500_000, 50_000])
@pytest.mark.parametrize("drift_ppm", [-200, 200])
def test_the_drift_is_known_while_no_ping_is_answered(drift_ppm: float, period_us: int) -> None:
    errors: list[float] = []
    for seed in range(20):
        clocks, estimator = Clocks(seed, drift_ppm * 1e-6), ClockEstimator()
        last = 10**9 + 63 * 500_000
        for sent_us in range(10**9, last + 1, period_us):
            estimator.add(clocks.exchange(sent_us))
        moment = last + 20_000_000  # the drift alone would make 4 ms of it
        host_us, bound_us = estimator.conversion.device_to_host(clocks.device_us(moment))
        errors.append(abs(host_us - moment))
        assert errors[-1] <= bound_us < 5_000
    assert sorted(errors)[10] < 600


def test_the_conversions_are_inverse() -> None:
    clocks, estimator = Clocks(5, 150e-6), ClockEstimator()
    for moment in range(10**9, 10**9 + 40 * GAP_US, GAP_US):
        estimator.add(clocks.exchange(moment))
    there, _ = estimator.conversion.host_to_device(moment)
    assert abs(estimator.conversion.device_to_host(there)[0] - moment) <= 1


@pytest.mark.parametrize("late_us", [0, 5_000, 900_000])
def test_a_32_bit_time_is_unwrapped_across_its_wrap(late_us: int) -> None:
    clocks, estimator = Clocks(8, 0.0), ClockEstimator()
    now = 10**9
    clocks.offset_us = 3 * 2**32 - 1_000 - now
    estimator.add(clocks.exchange(now))
    for elapsed in (0, 500, 999, 1_000, 1_500):
        latched = clocks.device_us(now + elapsed)
        assert estimator.unwrap(latched % 2**32, now + elapsed + late_us) == latched


def test_an_empty_estimator_says_so() -> None:
    assert not ClockEstimator().synchronised
    with pytest.raises(RuntimeError, match="not synchronised"):
        ClockEstimator().conversion.host_to_device(1)


def test_the_bound_covers_ways_that_turn_unequal_in_the_worst_order() -> None:
    # First all delay is on the way out, later all of it on the way back: an apparent drift.
    estimator = ClockEstimator()
    for number in range(64):
        sent = 10**9 + number * 500_000
        device = sent + (0 if number < 32 else 300)
        estimator.add(Exchange(sent, device, device, sent + 300))
    for held_over_us in (0, 1_000_000, 20_000_000, 60_000_000):
        moment = 10**9 + 63 * 500_000 + held_over_us
        host_us, bound_us = estimator.conversion.device_to_host(moment)
        assert abs(host_us - moment) <= bound_us


def test_the_bound_covers_ways_that_are_always_unequal() -> None:
    # All of the delay is on the way out: the estimate is off by half of it, which is the bound.
    estimator = ClockEstimator()
    for number in range(64):
        sent = 10**9 + number * 500_000
        estimator.add(Exchange(sent, sent + 300, sent + 300, sent + 300))
        host_us, bound_us = estimator.conversion.device_to_host(sent)
        assert abs(host_us - sent) == 150
        assert bound_us >= 150
    middle = 10**9 + 32 * 500_000
    host_us, bound_us = estimator.conversion.device_to_host(middle)
    assert abs(host_us - middle) <= bound_us < 200


def test_the_bound_covers_a_drift_that_changes_after_the_last_exchange() -> None:
    estimator = ClockEstimator()
    for number in range(64):
        sent = 10**9 + number * 500_000
        estimator.add(Exchange(sent, sent, sent, sent))
    for seconds in (10, 60):
        moment = sent + seconds * 1_000_000
        device_us = moment + round(seconds * 1.9)  # 1.9 ppm, as a crystal that warms up
        host_us, bound_us = estimator.conversion.device_to_host(device_us)
        assert abs(host_us - moment) <= bound_us


def test_a_device_whose_clock_stands_still_is_converted_within_its_bound() -> None:
    """Answers that are held up longer than the pings take make a line of slope -1."""
    estimator, device_us = ClockEstimator(), 5_000_000
    for number in range(24):
        sent_us = 10**9 + 1000 * number
        estimator.add(Exchange(sent_us, device_us, device_us, sent_us + 50_000))
    host_us, bound_us = estimator.conversion.device_to_host(device_us)
    assert abs(host_us - 10**9 - 25_000) <= bound_us
