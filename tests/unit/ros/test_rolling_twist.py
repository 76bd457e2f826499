from __future__ import annotations

import numpy as np
import pytest

from wheelwire import Pose, Twist
from wheelwire_ros.estimator import RobotMotion, WheelMotion
from wheelwire_ros.rolling_twist import RollingTwist

WHEEL = WheelMotion(1.0, 2.0)


def motion(linear_mps: float, angular_radps: float = 0.0) -> RobotMotion:
    twist = Twist(linear_mps, angular_radps)
    return RobotMotion(0.0, Pose(), np.zeros((3, 3)), twist, WHEEL, WHEEL, None)


def test_a_window_of_one_changes_nothing() -> None:
    rolling = RollingTwist(1)
    for measured in (motion(0.1), motion(0.3, -1.0)):
        assert rolling.smooth(measured, boot_id=1) is measured


def test_the_velocity_is_the_mean_of_the_last_samples_and_the_rest_stays() -> None:
    rolling = RollingTwist(2)
    means = [rolling.smooth(motion(v, -v), boot_id=1).twist for v in (0.1, 0.3, 0.7)]
    assert means == [pytest.approx(pair) for pair in ((0.1, -0.1), (0.2, -0.2), (0.5, -0.5))]
    assert rolling.smooth(motion(0.0), boot_id=1).left == WHEEL


def test_a_reset_of_the_device_begins_a_new_mean() -> None:
    rolling = RollingTwist(10)
    rolling.smooth(motion(1.0), boot_id=1)
    assert rolling.smooth(motion(0.0), boot_id=2).twist == (0.0, 0.0)
