"""The robot's motion from its samples: pose, covariance, velocity, wheel angles."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wheelwire import (
    DifferentialDrive,
    Odometry,
    OdometryUpdate,
    Pose,
    PoseCovariance,
    Twist,
    WheelSample,
    WheelVelocities,
)


class WheelMotion(NamedTuple):
    """One wheel about its axle, forward positive."""

    angle_rad: float
    """Since the start, unbounded."""
    velocity_radps: float


class RobotMotion(NamedTuple):
    """The robot's motion at one sample."""

    pose: Pose
    covariance: NDArray[np.float64]
    """Covariance of (x, y, heading), 3 by 3, in m and rad."""
    twist: Twist
    """The mean of the last samples."""
    left: WheelMotion
    right: WheelMotion
    battery_v: float | None
    twist_variances: tuple[float, float] | None = None
    """Variances of linear and angular velocity, if they are not measured."""


@dataclass(frozen=True)
class PoseRecord:
    """The pose at one sample, and what the wheels had counted by then.

    Attributes:
        board_id: The identity of the board that counted; empty where the driver has none.
        boot_id: The sample's.
        t_us: The device's time of it.
        left_ticks: The device's counter.
        right_ticks: The device's counter.
        left_total: Ticks since the odometry began, which joint_states shows.
        right_total: The same of the right wheel.
        pose: x and y in m, heading in rad.
        covariance: Covariance of the pose, 3 by 3, row by row.
        saved_s: When the node saved it, on the wall clock.
        is_final: Whether the wheels stood, and nothing of this node moved them later.
    """

    board_id: str
    boot_id: int
    t_us: int
    left_ticks: int
    right_ticks: int
    left_total: int
    right_total: int
    pose: tuple[float, float, float]
    covariance: tuple[float, ...]
    saved_s: float = 0.0
    is_final: bool = False


HELD_MPS, HELD_RADPS = 0.3, 0.3
"""The least that is assumed of a robot out of contact: somebody may push it."""
DRIVEN = 10.0
"""While a command may still drive it, a velocity of zero says nothing: its standard deviation is
that many times the last velocity. Otherwise a filter would take back the way of that time."""


class MotionEstimator:
    """Integrates samples, each once and in order. Another thread may reset the pose.

    Args:
        drive: The robot's geometry.
        wheel_variance_m: Variance of a wheel's travel per metre travelled. [m^2/m]
        window: The twist is the mean of this many samples, as in diff_drive_controller.
    """

    def __init__(self, drive: DifferentialDrive, wheel_variance_m: float, window: int = 1) -> None:
        self._lock = threading.Lock()
        self._odometry = Odometry(drive)
        self._covariance = PoseCovariance(wheel_variance_m, wheel_variance_m)
        self._left_ticks = self._right_ticks = 0
        self._last: WheelSample | None = None
        self._twists: deque[Twist] = deque(maxlen=window)
        self._motion: RobotMotion | None = None
        """At the last sample."""
        self.unseen_m = 0.0
        """How far a wheel may have travelled uncounted at the last reset of the device."""

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
            if update.rebased:
                self.unseen_m = max(abs(update.unseen_left_m), abs(update.unseen_right_m))
            last, self._last = self._last or sample, sample
            travel = sample.since(last)
            # Summed up here, because the device's counters wrap, and restart after a reset.
            self._left_ticks += travel.left
            self._right_ticks += travel.right
            if sample.boot_id != last.boot_id:
                self._twists.clear()
            self._twists.append(drive.twist(WheelVelocities(sample.left_mps, sample.right_mps)))
            linear_mps, angular_radps = map(sum, zip(*self._twists, strict=True))
            count = len(self._twists)
            self._motion = RobotMotion(
                update.pose,
                covariance,
                Twist(linear_mps / count, angular_radps / count),
                _wheel(self._left_ticks, sample.left_mps, drive),
                _wheel(self._right_ticks, sample.right_mps, drive),
                sample.battery_v,
            )
            return self._motion

    def held(self, age_s: float, *, is_driven: bool) -> RobotMotion | None:
        """The estimate for a robot that sends no samples; None before the first one.

        It has the last pose, a velocity of zero, and large variances: the robot may have driven on,
        or somebody may have pushed it.

        Args:
            age_s: The time since the last sample.
            is_driven: Whether a command may still drive it.
        """
        with self._lock:
            if self._motion is None:
                return None
            pose, last = self._odometry.pose, self._motion.twist
            fastest_mps = max(abs(last.linear_mps), HELD_MPS)
            fastest_radps = max(abs(last.angular_radps), HELD_RADPS)
            off_m, off_rad = fastest_mps * age_s, fastest_radps * age_s
            now = HELD_MPS, HELD_RADPS
            if is_driven:
                now = DRIVEN * fastest_mps, DRIVEN * fastest_radps
            return self._motion._replace(
                pose=pose,
                covariance=self._covariance.matrix + np.diag([off_m, off_m, off_rad]) ** 2,
                twist=Twist(0.0, 0.0),
                twist_variances=(now[0] ** 2, now[1] ** 2),
            )

    def reset(self) -> PoseRecord | None:
        """Move the origin of the odometry to the robot; returns as `set_pose`."""
        return self.set_pose(Pose(), np.zeros((3, 3)))

    def set_pose(self, pose: Pose, covariance: NDArray[np.float64]) -> PoseRecord | None:
        """Go on from this pose; its covariance is of (x, y, heading), 3 by 3.

        Returns where the robot is now, and at which sample; None before the first one.
        """
        with self._lock:
            self._odometry.reset(pose)
            self._covariance.matrix = covariance
            return self._record("", self._last)

    def restore(self, record: PoseRecord) -> None:
        """Go on from the state in this record, whose sample is the last one."""
        with self._lock:
            self._begin(record)

    def record(self, board_id: str = "", first: WheelSample | None = None) -> PoseRecord | None:
        """The pose at the last sample, to resume from; None before the first one.

        Args:
            board_id: For the record.
            first: Before the first update: the sample that will be the first.
        """
        with self._lock:
            return self._record(board_id, first or self._last)

    def _record(self, board_id: str, sample: WheelSample | None) -> PoseRecord | None:
        if sample is None:
            return None
        pose = self._odometry.pose
        return PoseRecord(
            board_id=board_id,
            boot_id=sample.boot_id,
            t_us=sample.t_us,
            left_ticks=sample.left_ticks,
            right_ticks=sample.right_ticks,
            left_total=self._left_ticks,
            right_total=self._right_ticks,
            pose=(pose.x_m, pose.y_m, pose.heading_rad),
            covariance=tuple(self._covariance.matrix.ravel().tolist()),
        )

    def resume(self, record: PoseRecord, first: WheelSample) -> OdometryUpdate:
        """Go on from a record of the same boot, before the first update.

        The estimator treats what the wheels counted since the record as one arc. The robot may have
        reached the arc's end by any other path with the same counts, so the covariance grows by the
        arc's bend, too.
        """
        with self._lock:
            self._begin(record)
            then = first._replace(
                t_us=record.t_us, left_ticks=record.left_ticks, right_ticks=record.right_ticks
            )
            self._odometry.update(then)
            update = self._odometry.update(first)
            self._covariance.update(update, self._odometry.drive.wheel_separation)
            bend_m = update.distance_m * update.turn_rad / 2
            self._widen(bend_m, 0.0)
            travel = first.since(then)
            self._left_ticks += travel.left
            self._right_ticks += travel.right
            self._last = first
            return update

    def resume_after_reset(self, record: PoseRecord, off_m: float, off_rad: float) -> None:
        """Go on from a record of another boot, before the first update.

        Args:
            record: Where the robot was.
            off_m: How far it may be from there.
            off_rad: By how much it may have turned.
        """
        with self._lock:
            self._begin(record)
            self._widen(off_m, off_rad)

    def _begin(self, record: PoseRecord) -> None:
        self._odometry.reset(Pose(*record.pose))
        self._covariance.matrix = np.array(record.covariance).reshape(3, 3)
        self._left_ticks, self._right_ticks = record.left_total, record.right_total

    def _widen(self, off_m: float, off_rad: float) -> None:
        growth = np.diag([off_m, off_m, off_rad]) ** 2
        self._covariance.matrix = self._covariance.matrix + growth


def _wheel(ticks: int, rim_mps: float, drive: DifferentialDrive) -> WheelMotion:
    turns = ticks / drive.counts_per_revolution
    # By the nominal radius, without calibration: the robot computed the rim's velocity with it.
    return WheelMotion(turns * 2 * math.pi, rim_mps / drive.wheel_radius)
