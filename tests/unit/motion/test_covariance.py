from __future__ import annotations

import math

import numpy as np
import pytest

from wheelwire.motion.covariance import PoseCovariance
from wheelwire.motion.kinematics import Twist
from wheelwire.motion.odometry import OdometryUpdate, Pose

SEPARATION_M = 0.2
VARIANCE = 1e-4


def update(pose: Pose, distance_m: float, turn_rad: float) -> OdometryUpdate:
    after = pose.advance(distance_m, turn_rad)
    return OdometryUpdate(after, Twist(0, 0), distance_m, turn_rad, 0.01, rebased=False)


def test_standing_still_adds_nothing() -> None:
    covariance = PoseCovariance(VARIANCE, VARIANCE)
    assert np.all(covariance.update(update(Pose(), 0, 0), SEPARATION_M) == 0)


def test_a_straight_metre_by_hand() -> None:
    """Both wheels travel s: var x = k s / 2, var heading = 2 k s / L^2, var y grows with s^3."""
    covariance = PoseCovariance(VARIANCE, VARIANCE)
    pose = Pose()
    for _ in range(1000):
        step = update(pose, 0.001, 0)
        pose = step.pose
        matrix = covariance.update(step, SEPARATION_M)
    heading_variance = 2 * VARIANCE / SEPARATION_M**2
    assert matrix[0, 0] == pytest.approx(VARIANCE / 2)
    assert matrix[2, 2] == pytest.approx(heading_variance)
    assert matrix[1, 1] == pytest.approx(heading_variance / 3, rel=1e-3)
    assert matrix[1, 2] == pytest.approx(heading_variance / 2, rel=1e-3)


def test_it_predicts_the_spread_of_simulated_runs() -> None:
    """The sample covariance of arcs whose wheels slip at random, by the model's own law."""
    random = np.random.default_rng(1)
    steps, runs, left_m, right_m = 50, 2000, 0.010, 0.014
    covariance = PoseCovariance(VARIANCE, 2 * VARIANCE)
    pose = Pose()
    for _ in range(steps):
        step = update(pose, (left_m + right_m) / 2, (right_m - left_m) / SEPARATION_M)
        pose = step.pose
        matrix = covariance.update(step, SEPARATION_M)
    ends = []
    for _ in range(runs):
        end = Pose()
        for _ in range(steps):
            left = left_m + random.normal(0, math.sqrt(VARIANCE * left_m))
            right = right_m + random.normal(0, math.sqrt(2 * VARIANCE * right_m))
            end = end.advance((left + right) / 2, (right - left) / SEPARATION_M)
        ends.append(end)
    sampled = np.cov(np.array(ends).T)
    assert np.sqrt(np.diag(sampled)) == pytest.approx(np.sqrt(np.diag(matrix)), rel=0.1)


def test_reset_forgets() -> None:
    covariance = PoseCovariance(VARIANCE, VARIANCE)
    covariance.update(update(Pose(), 1, 1), SEPARATION_M)
    covariance.reset()
    assert np.all(covariance.matrix == 0)


def test_a_metre_backwards_is_as_uncertain_as_one_forwards() -> None:
    forwards, backwards = PoseCovariance(VARIANCE, VARIANCE), PoseCovariance(VARIANCE, VARIANCE)
    there = forwards.update(update(Pose(), 1, 0), SEPARATION_M)
    back = backwards.update(update(Pose(), -1, 0), SEPARATION_M)
    assert np.diag(back) == pytest.approx(np.diag(there))
    assert there[0, 0] > 0
