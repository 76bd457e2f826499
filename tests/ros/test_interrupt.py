"""Ctrl-C while the node starts: whenever it comes, the node ends, and that is no failure."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from support.ros import TIMEOUT_S, Graph
from support.ros_process import RobotNode

CODE = """
import os, signal, threading
from wheelwire_ros.__main__ import main
threading.Timer({delay_s}, os.kill, [os.getpid(), signal.SIGINT]).start()
main()
"""
"""The moment counts from the beginning of the executable, whatever the computer is doing."""
MOMENTS_S = [0.02 + 0.13 * count for count in range(16)]
DRIVERS: tuple[dict[str, Any], ...] = ({"driver_type": "mock"}, {"port": "/dev/none"})


@pytest.mark.parametrize(("count", "delay_s"), list(enumerate(MOMENTS_S)))
def test_it_ends_at_once_and_well(graph: Graph, count: int, delay_s: float) -> None:
    node = RobotNode(graph, CODE.format(delay_s=delay_s), **DRIVERS[count % 2])
    with node:
        assert node.process.wait(TIMEOUT_S) == 0
    assert "Traceback" not in node.errors_at_end
