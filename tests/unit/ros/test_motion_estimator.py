from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from support.host_samples import sample
from wheelwire import DifferentialDrive, Pose, WheelSample
from wheelwire_ros.motion_estimator import MotionEstimator

DRIVE = DifferentialDrive(wheel_separation=0.2, wheel_radius=0.05, counts_per_revolution=1000)


@pytest.fixture
def motions() -> MotionEstimator:
    return estimator()


def estimator(window: int = 1) -> MotionEstimator:
    return MotionEstimator(DRIVE, wheel_variance_m=1e-4, window=window)


def test_one_turn_of_both_wheels(motions: MotionEstimator) -> None:
    motions.update(sample(left_ticks=70, right_ticks=-5))
    motion = motions.update(
        sample(left_ticks=1070, right_ticks=995, t_us=10**6, left_mps=0.3, right_mps=0.3)
    )
    assert motion.pose.x_m == pytest.approx(2 * math.pi * 0.05)
    assert motion.left == pytest.approx((2 * math.pi, 6.0))
    assert motion.twist == pytest.approx((0.3, 0.0))
    assert motion.covariance[0, 0] > 0


def test_resetting_the_odometry_leaves_the_wheels_where_they_are(motions: MotionEstimator) -> None:
    motions.update(sample())
    motions.update(sample(left_ticks=500, right_ticks=900, t_us=10**6))
    motions.reset()
    motion = motions.update(sample(left_ticks=500, right_ticks=900, t_us=2 * 10**6))
    assert motion.pose == Pose()
    assert np.all(motion.covariance == 0)
    assert motion.left.angle_rad == pytest.approx(math.pi)


def test_new_numbers_count_from_now_on(motions: MotionEstimator) -> None:
    motions.update(sample())
    one = motions.update(sample(left_ticks=100, right_ticks=100, t_us=1)).pose.x_m
    motions.drive = replace(DRIVE, wheel_radius=0.1)
    two = motions.update(sample(left_ticks=200, right_ticks=200, t_us=2)).pose.x_m
    assert two == pytest.approx(3 * one)


def measured(linear_mps: float, *, turn_mps: float = 0.0, boot_id: int = 1) -> WheelSample:
    return sample(left_mps=linear_mps - turn_mps, right_mps=linear_mps + turn_mps, boot_id=boot_id)


def test_a_window_of_one_changes_nothing(motions: MotionEstimator) -> None:
    for linear_mps, turn_mps in ((0.1, 0.0), (0.3, -0.1)):
        twist = motions.update(measured(linear_mps, turn_mps=turn_mps)).twist
        assert twist == pytest.approx((linear_mps, turn_mps * 10))


def test_the_velocity_is_the_mean_of_the_last_samples_and_the_rest_stays() -> None:
    motions = estimator(window=2)
    means = [motions.update(measured(v, turn_mps=-v / 10)).twist for v in (0.1, 0.3, 0.7)]
    assert means == [pytest.approx(pair) for pair in ((0.1, -0.1), (0.2, -0.2), (0.5, -0.5))]
    assert motions.update(measured(0.0)).left.velocity_radps == 0.0


def test_a_reset_of_the_device_begins_a_new_mean() -> None:
    motions = estimator(window=10)
    motions.update(measured(1.0))
    assert motions.update(measured(0.0, boot_id=2)).twist == (0.0, 0.0)
