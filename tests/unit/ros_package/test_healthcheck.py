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


@pytest.mark.parametrize(
    ("status", "node", "said"),
    [
        ((DiagnosticStatus.OK, "connected"), "/hardware_robot", "hardware_robot does not report"),
        (
            (DiagnosticStatus.ERROR, "unplugged?"),
            "/robot1/hardware_robot",
            "robot1/hardware_robot: link: unplugged?\n",
        ),
        (
            None,
            "/robot1/hardware_robot",
            "robot1/hardware_robot does not report: is the node running",
        ),
    ],
    ids=["another namespace", "no link", "no node"],
)
def test_unhealthy(
    reporter: Reporter, status: tuple[Any, str] | None, node: str, said: str
) -> None:
    if status is not None:
        reporter.says(*status)
    result = check(reporter.domain, node)
    assert result.returncode == 1
    assert result.stderr.startswith(said)
