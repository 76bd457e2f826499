"""Dead reckoning from wheel samples, on the device's clock."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..errors import InvalidArgument, shown
from ..samples import WheelSample
from .kinematics import DifferentialDrive, Twist

LONGEST_UNSEEN_S = 5.0
"""However long nothing was heard of a robot: `ttl_max_s`, at most this, ended its last setpoint."""
STRAIGHT_RAD = 1e-6
"""Below this turn the arc's formula divides by almost zero; the midpoint rule is exact then."""


class Pose(NamedTuple):
    """The robot's pose in the frame that it had at the last reset of the odometry."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0
    """Counter-clockwise, not wrapped: two turns are 4 pi."""

    def advance(self, distance_m: float, turn_rad: float) -> Pose:
        """The pose after a circular arc of `distance_m` that turns by `turn_rad`.

        Exact for constant wheel velocities (Siegwart and Nourbakhsh, Introduction to Autonomous
        Mobile Robots, section 5.2.4).
        """
        x, y, heading = self
        end = heading + turn_rad
        if abs(turn_rad) < STRAIGHT_RAD:
            middle = heading + turn_rad / 2
            return Pose(x + distance_m * math.cos(middle), y + distance_m * math.sin(middle), end)
        radius = distance_m / turn_rad
        return Pose(
            x + radius * (math.sin(end) - math.sin(heading)),
            y - radius * (math.cos(end) - math.cos(heading)),
            end,
        )


class OdometryUpdate(NamedTuple):
    """The change by one sample."""

    pose: Pose
    twist: Twist
    """Mean over the interval, by the device's clock; zero if no time has passed."""
    distance_m: float
    turn_rad: float
    dt_s: float
    rebased: bool
    """Whether the device was reset; the pose is unchanged then."""
    unseen_left_m: float = 0.0
    """How far the wheel may have travelled before the reset was over, uncounted: its last known
    speed times the time since. 0 without a reset."""
    unseen_right_m: float = 0.0
    """As `unseen_left_m`, for the other wheel."""


class Odometry:
    """Integrates samples to a pose. Feed each sample once, in order.

    Args:
        drive: The robot's geometry.
        pose: The initial pose; by default the origin.
    """

    def __init__(self, drive: DifferentialDrive, pose: Pose | None = None) -> None:
        if not isinstance(drive, DifferentialDrive):
            raise InvalidArgument(f"drive = {shown(drive)}: give the robot's `geometry`")
        self.drive = drive
        self.pose = pose or Pose()
        self.rebases = 0
        """How often the odometry was rebased after a reset of the device."""
        self._last: WheelSample | None = None

    def update(self, sample: WheelSample) -> OdometryUpdate:
        """Advance the pose by the travel since the previous sample; the first sets the start."""
        if not isinstance(sample, WheelSample):
            raise InvalidArgument(f"sample = {shown(sample)}: give what `read()` returns")
        last, self._last = self._last or sample, sample
        travel = sample.since(last)
        self.rebases += travel.rebased
        left_m = travel.left * self.drive.metres_per_tick * self.drive.left_radius_multiplier
        right_m = travel.right * self.drive.metres_per_tick * self.drive.right_radius_multiplier
        distance = (left_m + right_m) / 2
        turn = (right_m - left_m) / self.drive.wheel_separation
        self.pose = self.pose.advance(distance, turn)
        dt = travel.dt_s
        twist = Twist(distance / dt, turn / dt) if dt > 0 else Twist(0.0, 0.0)
        # By the host's clock: the device's restarted at the reset.
        unseen_s = min(sample.stamp - last.stamp, LONGEST_UNSEEN_S) if travel.rebased else 0.0
        return OdometryUpdate(
            self.pose,
            twist,
            distance,
            turn,
            dt,
            travel.rebased,
            last.left_mps * unseen_s,
            last.right_mps * unseen_s,
        )

    def reset(self, pose: Pose | None = None) -> None:
        """Set the pose, by default to the origin.

        The next sample is measured from the previous one.
        """
        self.pose = pose or Pose()
