"""What the node really publishes has one place each in the file for diagnostic_aggregator."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition

from support.aggregator import OTHER, Aggregator
from support.ros import Graph, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE
from wheelwire.simulation.simulator import Simulator
from wheelwire_ros.diagnostics import twin_status

FILE = Path(__file__).parents[2] / "ros_node" / "config" / "diagnostics_aggregator.yaml"


def test_every_status_has_one_place(graph: Graph, simulator: Simulator) -> None:
    """Of a closed node, of one without /clock, and of one with sensors."""
    reports = graph.listen(DiagnosticArray, "/diagnostics")
    # A twin is reported after 25 s.
    names = {twin_status(NODE.lstrip("/")).name}

    def subjects() -> set[str]:
        while reports:
            names.update(status.name for status in reports.popleft().status)
        return {name.partition(": ")[2] for name in names}

    with RobotNode(graph, port=simulator.port, use_sim_time=True, autostart=False):
        wait(lambda: "link" in subjects(), "a closed robot's status")
        assert subjects() == {"link", "name"}
        assert graph.change_state(NODE, Transition.TRANSITION_CONFIGURE)
        wait(lambda: any(one.startswith("sensor ") for one in subjects()), "sensors")
        wait(lambda: subjects() >= {"link", "robot", "commands", "clock", "name"}, "each status")
    aggregator = Aggregator(yaml.safe_load(FILE.read_text())["analyzers"]["ros__parameters"])
    places = {name: aggregator.takers(name) for name in names}
    assert all(len(found) == 1 for found in places.values()), places
    assert [OTHER] not in places.values(), places
    assert {found[0] for found in places.values()} == {a.path for a in aggregator.analyzers}
