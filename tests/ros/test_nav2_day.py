"""The judge of a day of Nav2 by proxy finds the violations that are planted.

`make nav2-day` lives such a day.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
pytest.importorskip("tf2_msgs.msg", reason="`make ros` builds tf2_msgs")

from support.nav2_day import open_day

TRIES = 5


ARMS_ITSELF = """
from wheelwire_ros import hardware_robot
from wheelwire_ros.robot_connection import RobotConnection
clear = RobotConnection.clear_estop
def clear_and_arm(self):
    clear(self)
    self.robot.set_wheel_velocity(0.0, 0.0, 0.3)
RobotConnection.clear_estop = clear_and_arm
hardware_robot.main()
"""
FALLS_SILENT = """
from wheelwire_ros import hardware_robot
from wheelwire_ros.open_robot import OpenRobot
OpenRobot._on_silent = lambda self: None
hardware_robot.main()
"""
GOES_BACK = """
from wheelwire_ros import hardware_robot
from wheelwire_ros.publishers import MotionPublisher
publish = MotionPublisher.publish
def publish_late(self, motion, stamp_ns, odom_ns):
    publish(self, motion, stamp_ns, odom_ns and odom_ns - (self.published % 50 == 49) * 10**9)
MotionPublisher.publish = publish_late
hardware_robot.main()
"""


@pytest.mark.parametrize(
    ("code", "parameters", "happening", "found"),
    [
        (ARMS_ITSELF, {}, "estop", "after a clear, unarmed"),
        (FALLS_SILENT, {}, "unplug", "the filter's error"),
        (GOES_BACK, {}, "die", "time ran backward in odom"),
        (None, {"left_wheel_radius_multiplier": 1.05}, "die", "odom's error"),
    ],
)
def test_a_planted_violation_is_found(
    tmp_path: Path, code: str | None, parameters: dict[str, Any], happening: str, found: str
) -> None:
    with open_day(tmp_path, 1, code, **parameters) as day:
        for _ in range(TRIES):
            day.goal(8.0, 0.3)
            day.wait_moving()
            time.sleep(2.0)  # for a way that is long enough to compare
            if happening == "unplug":
                day.unplug(3.0)
            else:
                getattr(day, happening)()
            day.come_to_rest()
            if any(found in violation for violation in day.violations):
                break
        assert any(found in violation for violation in day.violations), day.violations
