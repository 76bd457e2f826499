"""The SROS 2 policy names what the node really has, and lets nobody command or clear by mistake."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from nav_msgs.msg import Odometry

from support.ros import Graph
from support.ros_process import RobotNode
from support.ros_rig import NODE
from wheelwire.simulation.simulator import Simulator

POLICY = Path(__file__).parents[2] / "ros_node" / "security" / "wheelwire.policy.xml"
FOREIGN = {"/clock"}
"""Of others; and `range/*` is of boards with range sensors."""
OF_RCLPY = {f"{NODE}/get_type_description"}


def names(enclave: str, kind: str, right: str) -> set[str]:
    """What an enclave may do; a name is absolute, `~` is the node's."""
    root = ET.parse(POLICY).getroot()  # noqa: S314 - it is our own
    found: set[str] = set()
    for profile in root.findall(f".//enclave[@path='/wheelwire/{enclave}']//profile"):
        for group in profile.findall(f"{kind}s[@{right}='ALLOW']"):
            for one in group.findall(kind):
                text = str(one.text)
                found.add(
                    text.replace("~", f"/{profile.get('node')}") if "~" in text else f"/{text}"
                )
    return found


def test_the_node_may_do_what_it_does(graph: Graph, simulator: Simulator) -> None:
    with RobotNode(graph, port=simulator.port, publish_limited_velocity=True):
        graph.wait_active()
        graph.first(Odometry, "odom")
        node = graph.node

        def topics(found: list[tuple[str, list[str]]]) -> set[str]:
            return {name for name, _ in found}

        published = topics(node.get_publisher_names_and_types_by_node("hardware_robot", "/"))
        heard = topics(node.get_subscriber_names_and_types_by_node("hardware_robot", "/"))
        served = topics(node.get_service_names_and_types_by_node("hardware_robot", "/"))
    assert published | {"/range/*"} == names("robot", "topic", "publish")
    assert heard | FOREIGN == names("robot", "topic", "subscribe")
    assert served - OF_RCLPY == names("robot", "service", "reply")


def test_one_commands_and_another_clears() -> None:
    others = ("operator", "viewer")
    assert "/cmd_vel" in names("driver", "topic", "publish")
    assert not any("/cmd_vel" in names(one, "topic", "publish") for one in others)
    clears = {f"{NODE}/estop", f"{NODE}/clear_fault", f"{NODE}/set_parameters"}
    assert clears <= names("operator", "service", "request")
    for one in ("driver", "viewer"):
        assert clears.isdisjoint(names(one, "service", "request"))
    served = names("robot", "service", "reply")
    for one in ("driver", *others):
        assert names(one, "service", "request") <= served
