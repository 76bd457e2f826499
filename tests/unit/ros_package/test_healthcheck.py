"""The container's health check, as Docker runs it, against what a node would report."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from support.ros import Graph, Repeater, open_graph

CHECK = Path(__file__).parents[3] / "ros_node" / "docker" / "healthcheck.py"
NODE = "/robot1/hardware_robot"
RATE_HZ = 5.0
OK, ERROR = DiagnosticStatus.OK, DiagnosticStatus.ERROR


@pytest.fixture(scope="module")
def graph() -> Iterator[Graph]:
    with open_graph() as graph:
        yield graph


def check(domain: int, node: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, CHECK, node],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.parametrize(
    ("status", "node", "code", "said"),
    [
        ((DiagnosticStatus.OK, "connected"), NODE, 0, ""),
        ((DiagnosticStatus.OK, "connected"), "/other", 1, "other does not report"),
        (
            (DiagnosticStatus.ERROR, "unplugged?"),
            NODE,
            1,
            "robot1/hardware_robot: link: unplugged?\n",
        ),
        (None, NODE, 1, "robot1/hardware_robot does not report: is the node running"),
    ],
    ids=["healthy", "another namespace", "no link", "no node"],
)
def test_it_is_healthy_while_the_link_is_up(
    graph: Graph, status: tuple[Any, str] | None, node: str, code: int, said: str
) -> None:
    reports = []
    if status is not None:
        level, message = status
        reports.append(DiagnosticStatus(name=f"{NODE[1:]}: link", level=level, message=message))
    publisher = graph.node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    with Repeater(publisher, lambda: DiagnosticArray(status=reports), RATE_HZ):
        result = check(graph.domain, node)
    graph.destroy(publisher)
    assert result.returncode == code
    assert result.stderr.startswith(said)
