"""Every sample is published or counted, also when the node stands still for a while."""

from __future__ import annotations

import itertools
import signal
import time
from collections import deque
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import Odometry

from support.ros import Diagnostics, Graph, wait
from support.ros_process import RobotNode
from support.ros_rig import open_rig, stamp_s

FREEZE_S = 0.15
PERIOD_S = 0.02


def wait_for_more(odometry: deque[Any]) -> None:
    seen = len(odometry)
    wait(lambda: len(odometry) > seen + 10, "odom")


def test_after_short_freezes_no_sample_is_missing(tmp_path: Path) -> None:
    with open_rig(tmp_path) as rig:
        rig.odometry.clear()
        for _ in range(10):
            rig.node.process.send_signal(signal.SIGSTOP)
            time.sleep(FREEZE_S)
            rig.node.process.send_signal(signal.SIGCONT)
            wait_for_more(rig.odometry)
        # Before the report, which then counts all of them.
        stamps = [stamp_s(message) for message in tuple(rig.odometry)]
        link = rig.diagnostics.wait("link", lambda status, _: status.level == DiagnosticStatus.OK)
    steps = [later - earlier for earlier, later in itertools.pairwise(stamps)]
    missing = sum(round(step / PERIOD_S) - 1 for step in steps)
    assert missing == int(link["samples_dropped"]) + int(link["frames_lost"])
    assert int(link["samples_published"]) >= len(stamps)


def test_a_freeze_is_no_fault_of_the_mocks(graph: Graph) -> None:
    diagnostics = Diagnostics(graph)
    odometry = graph.listen(Odometry, "odom")
    with RobotNode(graph, driver_type="mock") as node:
        graph.wait_active()
        for _ in range(3):
            node.process.send_signal(signal.SIGSTOP)
            time.sleep(FREEZE_S)
            node.process.send_signal(signal.SIGCONT)
            wait_for_more(odometry)
        robot = diagnostics.wait("robot", lambda *_: True)
    assert (robot["state"], robot["faults"]) == ("IDLE", "")
