"""The container's health check, as Docker runs it, against what a node would report."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from support.ros import Graph, open_graph

CHECK = Path(__file__).parents[3] / "ros_node" / "docker" / "healthcheck.py"
PERIOD_S = 0.2


class Reporter:
    """Publishes again and again, as the node does; nothing while there is no status."""

    def __init__(self, graph: Graph) -> None:
        self.domain = graph.domain
        self.status: Any = None
        self._publisher = graph.node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="reporter")
        self._thread.start()

    def says(self, level: Any, message: str) -> None:
        self.status = DiagnosticStatus(
            name="robot1/hardware_robot: link", level=level, message=message
        )

    def close(self) -> None:
        self._end.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._end.wait(PERIOD_S):
            if self.status is not None:
                self._publisher.publish(DiagnosticArray(status=[self.status]))


@pytest.fixture
def reporter() -> Iterator[Reporter]:
    with open_graph() as graph:
        reporter = Reporter(graph)
        yield reporter
        reporter.close()


def check(domain: int, node: str = "/robot1/hardware_robot") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, CHECK, node],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_healthy_while_the_link_is_up(reporter: Reporter) -> None:
    reporter.says(DiagnosticStatus.OK, "connected")
    result = check(reporter.domain)
    assert result.returncode == 0, result.stderr


def test_a_namespace_is_another_robot(reporter: Reporter) -> None:
    reporter.says(DiagnosticStatus.OK, "connected")
    result = check(reporter.domain, "/hardware_robot")
    assert result.returncode == 1
    assert result.stderr.startswith("hardware_robot does not report")


def test_unhealthy_without_a_link(reporter: Reporter) -> None:
    reporter.says(DiagnosticStatus.ERROR, "unplugged?")
    result = check(reporter.domain)
    assert result.returncode == 1
    assert result.stderr.strip() == "robot1/hardware_robot: link: unplugged?"


def test_unhealthy_without_a_node(reporter: Reporter) -> None:
    result = check(reporter.domain)
    assert result.returncode == 1
    assert result.stderr.startswith("robot1/hardware_robot does not report: is the node running")
