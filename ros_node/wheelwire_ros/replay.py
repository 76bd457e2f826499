"""Replays a recording of joint_states into the estimator, for the pose that odom had then."""

from __future__ import annotations

import math
from typing import Any

from wheelwire import DifferentialDrive, Fault, SupervisorState, WheelSample

from .conversions import NANOSECONDS, time_ns
from .estimator import MotionEstimator, RobotMotion

TICK_MODULUS = 1 << 32


class JointReplay:
    """Estimates the motion from the messages of joint_states, each once and in order.

    A wheel's angle is its ticks by an exact number, so the ticks are found again without error, and
    the pose is that of odom to the last bit, with the same geometry, and while neither a message
    nor a sample was left out: `publish_rate` was the robot's own rate, and the odometry was not
    reset.

    Args:
        drive: The robot's geometry, with its calibration.
        wheel_variance_m: The node's `wheel_variance`. [m^2/m]
        joints: The names of a left and a right joint.
    """

    def __init__(
        self,
        drive: DifferentialDrive,
        wheel_variance_m: float,
        joints: tuple[str, str] = ("left_wheel_joint", "right_wheel_joint"),
    ) -> None:
        self.estimator = MotionEstimator(drive, wheel_variance_m)
        self._joints = joints

    def update(self, message: Any) -> RobotMotion:
        """The motion at the next sensor_msgs/JointState; raises ValueError without the joints."""
        left, right = (message.name.index(joint) for joint in self._joints)
        stamp_ns = time_ns(message.header.stamp)
        radius_m = self.estimator.drive.wheel_radius
        return self.estimator.update(
            WheelSample(
                # One boot for all: angles continue across a reset of the device.
                boot_id=0,
                t_us=stamp_ns // 1000,
                left_ticks=self._ticks(message.position[left]),
                right_ticks=self._ticks(message.position[right]),
                left_mps=message.velocity[left] * radius_m,
                right_mps=message.velocity[right] * radius_m,
                left_duty=0.0,
                right_duty=0.0,
                command_seq=0,
                state=SupervisorState.IDLE,
                faults=Fault(0),
                overruns=0,
                battery_v=None,
                stamp=stamp_ns / NANOSECONDS,
                stamp_error_s=0.0,
            )
        )

    def _ticks(self, angle_rad: float) -> int:
        turns = angle_rad / (2 * math.pi)
        # Wrapped as the device's counters are: the estimator expects 32 bits.
        return round(turns * self.estimator.drive.counts_per_revolution) % TICK_MODULUS
