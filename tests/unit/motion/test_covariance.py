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


def test_the_error_of_each_wheel_alone_by_hand() -> None:
    """A straight metre, heading along x: a wheel's error e moves x by e / 2, and turns by e / L.

    It moves y by s e / 2 L, to the left for the right wheel and to the right for the left one.
    """
    for left, right, sign in ((VARIANCE, 0.0, -1), (0.0, VARIANCE, 1)):
        matrix = PoseCovariance(left, right).update(update(Pose(), 1, 0), SEPARATION_M)
        expected = VARIANCE * np.array(
            [
                [0.25, sign * 1.25, sign * 2.5],
                [sign * 1.25, 6.25, 12.5],
                [sign * 2.5, 12.5, 25.0],
            ]
        )
        assert matrix == pytest.approx(expected)


def test_an_arc_about_a_wheel_that_stands_is_uncertain_by_the_other_one_alone() -> None:
    """A quarter turn to the left about the left wheel: the right one alone travels, L pi / 2."""
    quarter = math.pi / 2
    step = update(Pose(), SEPARATION_M * quarter / 2, quarter)
    assert np.all(PoseCovariance(VARIANCE, 0.0).update(step, SEPARATION_M) == pytest.approx(0.0))
    matrix = PoseCovariance(0.0, VARIANCE).update(step, SEPARATION_M)
    # L = 0.2 m: k s / L^2 = 1e-4 * 0.31416 / 0.04.
    assert matrix[2, 2] == pytest.approx(7.854e-4, rel=1e-3)
    # Along the middle of the arc, at 45 degrees: x by (1/2 - pi/8) / sqrt 2, y by (1/2 + pi/8)
    # / sqrt 2.
    variance = 3.1416e-5
    assert matrix[0, 0] == pytest.approx(variance * 0.0757**2, rel=1e-2)
    assert matrix[1, 1] == pytest.approx(variance * 0.6312**2, rel=1e-2)
    assert matrix[0, 2] == pytest.approx(variance * 0.0757 * 5, rel=1e-2)
    assert matrix[1, 2] == pytest.approx(variance * 0.6312 * 5, rel=1e-2)


def test_what_was_uncertain_before_a_metre_is_carried_along_it() -> None:
    """Heading along y: an uncertain heading moves x to the left of the way, and not y."""
    covariance = PoseCovariance(0.0, 0.0)
    covariance.matrix = np.diag([0.0, 0.0, 0.01])
    north = Pose(0.0, 0.0, math.pi / 2)
    matrix = covariance.update(update(north, 2.0, 0.0), SEPARATION_M)
    assert matrix == pytest.approx(np.array([[0.04, 0, -0.02], [0, 0, 0], [-0.02, 0, 0.01]]))


def test_across_a_reset_each_wheel_may_have_rolled_unseen() -> None:
    """Along x, by hand: both wheels 0.1 m, in common and 30 % of it apart; L = 0.2 m."""
    step = OdometryUpdate(
        Pose(), Twist(0, 0), 0.0, 0.0, 0.01, rebased=True, unseen_left_m=0.1, unseen_right_m=0.1
    )
    matrix = PoseCovariance(0.0, 0.0).update(step, SEPARATION_M)
    assert matrix[0, 0] == pytest.approx(0.1**2 + 2 * 0.03**2 / 4)
    assert matrix[2, 2] == pytest.approx(2 * 0.03**2 / 0.04)
    assert matrix[1, 1] == pytest.approx(2 * (0.25 * 0.03) ** 2)
    for left, right, sign in ((0.1, 0.0, -1), (0.0, 0.1, 1)):
        step = OdometryUpdate(
            Pose(), Twist(0, 0), 0, 0, 0.01, rebased=True, unseen_left_m=left, unseen_right_m=right
        )
        matrix = PoseCovariance(0.0, 0.0).update(step, SEPARATION_M)
        # A turn of half a radian about the other wheel, and the roll-out.
        assert matrix[2, 2] == pytest.approx(0.25 * 1.09)
        # Along the middle of that turn: (sin 0.25 / 2 + cos 0.25 / 8) x 0.1 m, and the bend.
        assert matrix[1, 1] == pytest.approx(0.02448**2 * 1.09 + 0.00625**2, rel=1e-2)
        assert matrix[0, 2] > 0 if sign == 1 else matrix[0, 2] < 0
