"""The mean velocity of the last samples, as diff_drive_controller publishes it."""

from __future__ import annotations

from collections import deque

from wheelwire import Twist

from .estimator import RobotMotion


class RollingTwist:
    """Replaces the velocity of each motion by the mean of the last ones.

    Args:
        size: How many; with 1 the velocity stays as measured.
    """

    def __init__(self, size: int) -> None:
        self._twists: deque[Twist] = deque(maxlen=size)
        self._boot_id: int | None = None

    def smooth(self, motion: RobotMotion, boot_id: int) -> RobotMotion:
        """The next motion; a reset of the device begins a new mean."""
        if boot_id != self._boot_id:
            self._boot_id = boot_id
            self._twists.clear()
        self._twists.append(motion.twist)
        count = len(self._twists)
        if count == 1:
            return motion
        linear_mps = sum(twist.linear_mps for twist in self._twists) / count
        angular_radps = sum(twist.angular_radps for twist in self._twists) / count
        return motion._replace(twist=Twist(linear_mps, angular_radps))
