from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wheelwire import Twist
from wheelwire_ros.speed_limiter import FIRST_STEP_S, MAX_STEP_S, AxisLimits, Limits, SpeedLimiter

TTL_S = 0.5
PERIOD_S = 0.05


def run(
    targets: list[float], axis: AxisLimits, period_s: float = PERIOD_S, *, start_s: float = 100.0
) -> list[float]:
    """The velocities along x for a command in each period."""
    limiter = SpeedLimiter()
    limits = Limits(linear=axis)
    told = []
    for index, target in enumerate(targets):
        now_s = start_s + index * period_s
        # The turn rate keeps a command of zero along x from being a stop.
        twist = limiter.limit(Twist(target, 0.1), limits, now_s)
        limiter.obeyed(twist, now_s, TTL_S)
        told.append(twist.linear_mps)
    return told


def test_velocity_is_limited_each_way_and_the_path_keeps_its_curvature() -> None:
    limits = Limits(AxisLimits(max_velocity=0.4, min_velocity=-0.2), AxisLimits(max_velocity=2.0))
    limiter = SpeedLimiter()
    assert limiter.limit(Twist(0.8, -1.0), limits, 0.0) == pytest.approx((0.4, -0.5))
    assert limiter.limit(Twist(0.1, 4.0), limits, 0.0) == pytest.approx((0.05, 2.0))
    assert limiter.limit(Twist(-0.4, 1.0), limits, 0.0) == pytest.approx((-0.2, 0.5))
    assert limiter.limit(Twist(-0.1, 0.5), limits, 0.0) == (-0.1, 0.5)


def test_a_direction_can_be_forbidden_and_turning_remains() -> None:
    limits = Limits(linear=AxisLimits(max_velocity=0.4, min_velocity=0.0))
    assert SpeedLimiter().limit(Twist(-0.3, 1.0), limits, 0.0) == (0.0, 1.0)


def test_it_speeds_up_and_slows_down_by_the_limits_of_its_direction() -> None:
    axis = AxisLimits(
        max_acceleration=1.0,
        max_deceleration=-2.0,
        max_acceleration_reverse=-3.0,
        max_deceleration_reverse=4.0,
    )
    assert run([0.4] * 3, axis) == pytest.approx([0.05, 0.10, 0.15])
    assert run([-0.4] * 3, axis) == pytest.approx([-0.15, -0.30, -0.40])
    assert run([0.05, 0.1, 0.15, 0.0, 0.0], axis)[3:] == pytest.approx([0.05, 0.0])
    assert run([-0.15, -0.3, 0.0, 0.0], axis)[2:] == pytest.approx([-0.1, 0.0])


def test_a_reversal_slows_down_then_speeds_up_within_one_step() -> None:
    axis = AxisLimits(max_acceleration=1.0, max_deceleration=-2.0)
    # From 0.05 it takes 25 ms to stop; the other 25 ms give -0.025.
    assert run([0.05, -1.0], axis) == pytest.approx([0.05, -0.025])


def test_an_acceleration_builds_up_by_the_jerk_and_ends_at_the_target() -> None:
    told = run([0.4] * 30, AxisLimits(max_jerk=4.0))
    accelerations = [(b - a) / PERIOD_S for a, b in pairwise([0.0, *told])]
    assert accelerations[:3] == pytest.approx([0.2, 0.4, 0.6])
    assert max(told) == told[-1] == pytest.approx(0.4)


@pytest.mark.parametrize("axis", [AxisLimits(max_acceleration=0.1), AxisLimits(max_jerk=0.1)])
def test_a_stop_is_never_limited(axis: AxisLimits) -> None:
    limiter, limits = SpeedLimiter(), Limits(axis, axis)
    limiter.obeyed(Twist(1.0, 1.0), 100.0, TTL_S)
    assert limiter.limit(Twist(0.0, 0.0), limits, 100.001) == (0.0, 0.0)


def test_a_robot_whose_command_expired_starts_from_zero() -> None:
    limiter, limits = SpeedLimiter(), Limits(AxisLimits(max_acceleration=1.0))
    limiter.obeyed(Twist(1.0, 0.0), 100.0, TTL_S)
    told = limiter.limit(Twist(1.0, 0.0), limits, 100.0 + TTL_S)
    assert told.linear_mps == pytest.approx(FIRST_STEP_S)


def test_a_pause_between_commands_gains_no_speed() -> None:
    told = run([5.0, 5.0], AxisLimits(max_acceleration=1.0), period_s=0.4)
    assert told == pytest.approx([FIRST_STEP_S, FIRST_STEP_S + MAX_STEP_S])


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_finite_stays_so_for_the_driver_to_refuse(value: float) -> None:
    limits = Limits(AxisLimits(max_velocity=0.4), AxisLimits(max_velocity=2.0))
    assert not math.isfinite(SpeedLimiter().limit(Twist(value, 0.0), limits, 0.0).linear_mps)


bounds = st.floats(0, 10) | st.just(math.nan)
velocities = st.lists(st.floats(-5, 5), min_size=1, max_size=30)
periods = st.floats(0.001, MAX_STEP_S)


def magnitude(value: float) -> float:
    return math.inf if math.isnan(value) else value


@given(velocities, bounds, bounds, bounds, periods)
def test_no_limit_is_exceeded_and_no_target_passed(
    targets: list[float], fastest: float, acceleration: float, deceleration: float, period_s: float
) -> None:
    axis = AxisLimits(
        max_velocity=fastest, max_acceleration=acceleration, max_deceleration=-deceleration
    )
    told = run(targets, axis, period_s)
    top = magnitude(fastest)
    rate = magnitude(acceleration)
    rate = max(rate, rate if math.isnan(deceleration) else deceleration)
    for index, (before, after) in enumerate(pairwise([0.0, *told])):
        dt_s = period_s if index else FIRST_STEP_S
        target = max(-top, min(top, targets[index]))
        assert abs(after) <= top
        assert abs(after - before) <= rate * dt_s * (1 + 1e-6) + 1e-9
        low, high = sorted((before, target))
        assert low - 1e-9 <= after <= high + 1e-9


@given(velocities, st.floats(0.1, 50), periods)
def test_an_acceleration_grows_no_faster_than_the_jerk(
    targets: list[float], jerk: float, period_s: float
) -> None:
    told = run(targets, AxisLimits(max_jerk=jerk), period_s)
    steps = [FIRST_STEP_S] + [period_s] * (len(told) - 1)
    rates = [(b - a) / dt for (a, b), dt in zip(pairwise([0.0, *told]), steps, strict=True)]
    for (before, after), dt_s in zip(pairwise([0.0, *rates]), steps, strict=True):
        # It may end at once; from zero, or from what it was, it grows by the jerk.
        grown = abs(after) - (abs(before) if before * after > 0 else 0.0)
        assert grown <= jerk * dt_s * (1 + 1e-6) + 1e-6
