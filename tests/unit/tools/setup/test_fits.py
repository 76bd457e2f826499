"""The models that measurements are fitted to, on data that follow them exactly."""

from __future__ import annotations

import math

import pytest

from wheelwire.tools.setup.fits import fit_first_order, fit_line
from wheelwire.tools.setup.gains import simc_pi
from wheelwire.tools.setup.identification import steady_rate


def test_a_line_is_found_from_its_points() -> None:
    line = fit_line([(duty, 0.8 * (duty - 0.1)) for duty in (0.2, 0.3, 0.5, 0.6)])
    assert line.slope == pytest.approx(0.8)
    assert line.offset == pytest.approx(0.1)
    assert line.deviation == pytest.approx(0, abs=1e-9)


def _lag(elapsed: float, time_constant_s: float) -> float:
    return 1 - math.exp(-elapsed / time_constant_s) if elapsed > 0 else 0.0


@pytest.mark.parametrize("delay_s", [0.0, 0.013, 0.04])
@pytest.mark.parametrize("time_constant_s", [0.008, 0.05, 0.3])
def test_delay_and_time_constant_are_found_from_a_rise_and_a_fall(
    delay_s: float, time_constant_s: float
) -> None:
    times = [0.01 * step - 0.1 + 0.003 for step in range(60)]
    answers = [_lag(time - delay_s, time_constant_s) for time in times]
    rise = [(time, 0.1 + 0.3 * answer) for time, answer in zip(times, answers, strict=True)]
    fall = [(time, 0.4 - 0.3 * answer) for time, answer in zip(times, answers, strict=True)]
    found = fit_first_order([rise, fall], 0.0)
    assert found.delay_s == pytest.approx(delay_s, abs=1e-3)
    assert found.time_constant_s == pytest.approx(time_constant_s, rel=0.03, abs=5e-4)


def test_the_ramp_of_the_duty_does_not_count_as_a_delay() -> None:
    # A very fast wheel follows the ramp itself, which takes 0.1 s.
    times = [0.01 * step for step in range(-10, 60)]
    points = [(time, min(max(time / 0.1, 0.0), 1.0)) for time in times]
    found = fit_first_order([points], 0.1)
    assert found.delay_s < 0.002
    assert found.time_constant_s < 0.005


def test_a_rate_is_counted_over_whole_turns() -> None:
    # 100 ticks a turn, a turn in 1 s; the first half of each turn has 60 of them.
    def ticks(time: float) -> int:
        part = time % 1
        return round(100 * (time // 1) + (120 * part if part < 0.5 else 60 + 80 * (part - 0.5)))

    times = [0.01 * step for step in range(231)]
    travel = [ticks(time) for time in times]
    assert travel[-1] / times[-1] > 101
    assert steady_rate(times, travel, 100) == pytest.approx(100, rel=0.005)
    assert steady_rate(times, [-count for count in travel], 100) == pytest.approx(-100, rel=0.005)


def test_simc_by_hand() -> None:
    # k = 2, lag 0.5 s, delay 0.1 s, closed loop 0.1 s: 0.5 / (2 * 0.2), and min(0.5, 4 * 0.2).
    assert simc_pi(2, 0.5, 0.1, 0.1) == pytest.approx((1.25, 0.5))
    # A lag of 2 s is more than four times their sum.
    assert simc_pi(2, 2.0, 0.1, 0.1) == pytest.approx((5.0, 0.8))
