"""Half an hour of Nav2 by proxy, and violations that its judge has to find."""

from __future__ import annotations

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
pytest.importorskip("tf2_msgs.msg", reason="`make ros` builds tf2_msgs")

from support.nav2_day import Day, open_day

ROBOTS, SECONDS = 3, 600.0
"""Side by side, half an hour in all. `python -m support.nav2_day 1800 7` in tests/: one robot's."""
TRIES = 5


@pytest.mark.timeout(2 * SECONDS)
def test_nothing_happens_that_should_not(tmp_path: Path) -> None:
    def live(seed: int) -> Day:
        with open_day(tmp_path, seed) as day:
            day.run(SECONDS)
            return day

    with ThreadPoolExecutor(ROBOTS) as robots:
        days = list(robots.map(live, range(1, ROBOTS + 1)))
    for day in days:
        sys.stdout.write(f"{day.table()}\n")
    assert [violation for day in days for violation in day.violations] == []
    for happening in ("unplug", "reset", "estop", "press", "bump", "set_geometry", "die"):
        assert all(day.counts[happening] > 2 for day in days), happening


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
def publish_late(self, motion, stamp_ns, **options):
    publish(self, motion, stamp_ns - (self.published % 50 == 49) * 10**9, **options)
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
