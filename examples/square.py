"""Drive a square by odometry: python examples/square.py /dev/ttyUSB0."""

from __future__ import annotations

import argparse
import math
import sys

import wheelwire

ROBOT = "a port, a YAML file, mock, ...; default: $WHEELWIRE_ROBOT"
SPEED_MPS = 0.2
TURN_RADPS = 1.0
TTL_S = 0.3  # a setpoint expires after this, even if this program hangs


def drive_straight(robot: wheelwire.Robot, odometry: wheelwire.Odometry, side_m: float) -> None:
    """Drive `side_m` along the present heading, and stop."""
    start = odometry.pose
    while True:
        pose = odometry.update(robot.read()).pose
        left_m = side_m - math.hypot(pose.x_m - start.x_m, pose.y_m - start.y_m)
        if left_m < 0.002:
            break
        linear = min(SPEED_MPS, max(0.03, 2.0 * left_m))  # slow down towards the end
        robot.set_velocity(linear, 2.0 * (start.heading_rad - pose.heading_rad), ttl=TTL_S)
    come_to_rest(robot, odometry)


def turn_to(robot: wheelwire.Robot, odometry: wheelwire.Odometry, heading_rad: float) -> None:
    """Turn on the spot, and stop."""
    while True:
        left_rad = heading_rad - odometry.update(robot.read()).pose.heading_rad
        if abs(left_rad) < 0.01:
            break
        speed = min(TURN_RADPS, max(0.2, 2.0 * abs(left_rad)))
        robot.set_velocity(0.0, math.copysign(speed, left_rad), ttl=TTL_S)
    come_to_rest(robot, odometry)


def come_to_rest(robot: wheelwire.Robot, odometry: wheelwire.Odometry) -> None:
    """Stop, and update the odometry until the wheels are at rest."""
    robot.stop()
    while True:
        sample = robot.read()
        odometry.update(sample)
        if sample.left_mps == 0 and sample.right_mps == 0:
            return


def main() -> None:
    """Drive the square."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot", nargs="?", help=ROBOT)
    parser.add_argument("--side", type=float, default=0.5, help="in metres")
    arguments = parser.parse_args()

    with wheelwire.connect(arguments.robot) as robot:
        odometry = wheelwire.Odometry(robot.geometry)
        odometry.update(robot.read())
        for corner in range(1, 5):
            drive_straight(robot, odometry, arguments.side)
            turn_to(robot, odometry, corner * math.pi / 2)
            x, y, heading = odometry.pose
            print(f"corner {corner}: x {x:+.3f} m, y {y:+.3f} m, {math.degrees(heading):+.1f} deg")


if __name__ == "__main__":
    try:
        main()
    except wheelwire.WheelwireError as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        sys.exit("interrupted; the robot was stopped")
