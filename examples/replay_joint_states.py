"""Recompute the poses of odom from a recording of joint_states.

Start `python examples/replay_joint_states.py` in a shell with ROS, then `ros2 bag play RECORDING`.
A wheel's angle is its ticks divided by an exact number. So the poses are those of odom to the last
bit, if the geometry is the same, the recording has every sample (`publish_rate` was the robot's own
rate), and nobody reset the odometry.
"""

from __future__ import annotations

import argparse
import math
import sys
from contextlib import suppress
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState

from wheelwire import DifferentialDrive, Fault, Odometry, Pose, SupervisorState, WheelSample

DEPTH = 1000  # messages that may wait for this program


class JointReplay:
    """Integrates the messages of joint_states, each once and in order.

    Args:
        drive: The robot's geometry, with its calibration.
        joints: The names of a left and a right joint.
    """

    def __init__(
        self,
        drive: DifferentialDrive,
        joints: tuple[str, str] = ("left_wheel_joint", "right_wheel_joint"),
    ) -> None:
        self._odometry = Odometry(drive)
        self._joints = joints

    def update(self, message: JointState) -> Pose:
        """The pose at the next message; raises ValueError if the message lacks the joints."""
        left, right = (message.name.index(joint) for joint in self._joints)
        stamp = message.header.stamp
        radius_m = self._odometry.drive.wheel_radius
        sample = WheelSample(
            boot_id=0,  # one for all: the angles continue across a reset of the device
            t_us=stamp.sec * 1_000_000 + stamp.nanosec // 1000,
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
            stamp=stamp.sec + stamp.nanosec / 1e9,
            stamp_error_s=0.0,
        )
        return self._odometry.update(sample).pose

    def _ticks(self, angle_rad: float) -> int:
        turns = angle_rad / (2 * math.pi)
        # The device's counters wrap at 32 bits, and so must these.
        return round(turns * self._odometry.drive.counts_per_revolution) % (1 << 32)


def main() -> None:
    """Print a pose for each message until Ctrl-C."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--separation", type=float, default=0.20, help="of the wheels [m]")
    parser.add_argument("--radius", type=float, default=0.033, help="of a wheel [m]")
    parser.add_argument("--counts", type=float, default=360, help="per revolution of a wheel")
    arguments = parser.parse_args(remove_ros_args(sys.argv)[1:])
    drive = DifferentialDrive(arguments.separation, arguments.radius, arguments.counts)
    replay = JointReplay(drive)

    def show(message: Any) -> None:
        pose = replay.update(message)
        print(f"x {pose.x_m:.4f} m, y {pose.y_m:.4f} m, heading {pose.heading_rad:.4f} rad")

    rclpy.init()
    node = rclpy.create_node("replay_joint_states")
    node.create_subscription(JointState, "joint_states", show, DEPTH)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == "__main__":
    main()
