"""Graphs of the tests, which must not meet those of other processes."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from support import ros
from support.ros import Graph

OTHER = """
import sys
import rclpy
rclpy.init(domain_id=int(sys.argv[1]))
node = rclpy.create_node("other")
print("there", flush=True)
sys.stdin.read()
"""


def test_a_graph_keeps_away_from_a_domain_in_use(
    graph: Graph, monkeypatch: pytest.MonkeyPatch
) -> None:
    occupied = 1 + graph.domain % ros.DOMAINS
    with subprocess.Popen(
        [sys.executable, "-c", OTHER, str(occupied)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as other:
        assert other.stdin
        assert other.stdout
        assert other.stdout.readline() == "there\n"
        monkeypatch.setattr(ros, "_domains", iter(range(graph.domain - 1, graph.domain + 9)))
        domain, reservation = ros.take_domain()
        reservation.close()
        other.stdin.close()
    assert domain not in (graph.domain, occupied)
