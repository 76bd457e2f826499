"""The robot's motion from its samples: pose, covariance, velocity, wheel angles."""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING, NamedTuple

from wheelwire import (
    DifferentialDrive,
    Odometry,
    Pose,
    PoseCovariance,
    Twist,
    WheelSample,
    WheelVelocities,
)

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


class WheelMotion(NamedTuple):
    """One wheel about its axle, forward positive."""

    angle_rad: float
    """Since the start, unbounded."""
    velocity_radps: float


class RobotMotion(NamedTuple):
    """The robot's motion at one sample."""

    stamp_s: float
    """Time of the sample on the monotonic clock."""
    pose: Pose
    covariance: npt.NDArray[np.float64]
    """Covariance of (x, y, heading), 3 by 3, in m and rad."""
    twist: Twist
    left: WheelMotion
    right: WheelMotion
    battery_v: float | None


class MotionEstimator:
    """Integrates samples, each once and in order. Another thread may reset the pose.

    Args:
        drive: The robot's geometry.
        wheel_variance_m: Variance of a wheel's travel per metre travelled. [m^2/m]
    """

    def __init__(self, drive: DifferentialDrive, wheel_variance_m: float) -> None:
        self._lock = threading.Lock()
        self._odometry = Odometry(drive)
        self._covariance = PoseCovariance(wheel_variance_m, wheel_variance_m)
        self._left_ticks = self._right_ticks = 0
        self._last: WheelSample | None = None

    @property
    def drive(self) -> DifferentialDrive:
        """The robot's geometry; a change applies from the next sample on."""
        return self._odometry.drive

    @drive.setter
    def drive(self, drive: DifferentialDrive) -> None:
        with self._lock:
            self._odometry.drive = drive

    @property
    def rebases(self) -> int:
        """How often the odometry was rebased after a reset of the device."""
        return self._odometry.rebases

    def update(self, sample: WheelSample) -> RobotMotion:
        """Integrate the next sample."""
        with self._lock:
            drive = self._odometry.drive
            update = self._odometry.update(sample)
            covariance = self._covariance.update(update, drive.wheel_separation)
            travel = sample.since(self._last or sample)
            self._last = sample
            # Summed up here, since the device's counters wrap, and begin anew after a reset.
            self._left_ticks += travel.left
            self._right_ticks += travel.right
            return RobotMotion(
                sample.stamp,
                update.pose,
                covariance,
                drive.twist(WheelVelocities(sample.left_mps, sample.right_mps)),
                _wheel(self._left_ticks, sample.left_mps, drive),
                _wheel(self._right_ticks, sample.right_mps, drive),
                sample.battery_v,
            )

    def reset(self) -> None:
        """Move the origin of the odometry to the robot."""
        with self._lock:
            self._odometry.reset()
            self._covariance.reset()


def _wheel(ticks: int, rim_mps: float, drive: DifferentialDrive) -> WheelMotion:
    turns = ticks / drive.counts_per_revolution
    # By the nominal radius, without calibration: with it the robot computed the rim's velocity.
    return WheelMotion(turns * 2 * math.pi, rim_mps / drive.wheel_radius)
