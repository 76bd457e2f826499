"""Several robots on one graph: each in a namespace of its own, and two nodes of one name."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
pytest.importorskip("tf2_msgs.msg", reason="`make ros` builds tf2_msgs")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage

from support.launch_stand_in import load, started
from support.ros import Diagnostics, Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import SPEED_MPS, twist
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import SupervisorState

ROS_NODE = Path(__file__).parents[2] / "ros_node"
LAUNCH = ROS_NODE / "launch" / "hardware_bringup.launch.py"
HEALTH = ROS_NODE / "docker" / "healthcheck.py"
MODEL = ROS_NODE / "urdf" / "pi4b.urdf"


def model_joints() -> set[str]:
    """The joints that move."""
    joints = ET.parse(MODEL).getroot().iter("joint")  # noqa: S314 - our own file
    return {joint.attrib["name"] for joint in joints if joint.attrib["type"] == "continuous"}


def health(graph: Graph, node: str) -> int:
    """The exit code of the container's health check."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(graph.domain)}
    return subprocess.run([sys.executable, HEALTH, node], env=environment, check=False).returncode


def test_they_do_not_hear_each_other_and_share_one_tf(graph: Graph, tmp_path: Path) -> None:
    left_odometry = graph.listen(Odometry, "/left/odom")
    right_odometry = graph.listen(Odometry, "/right/odom")
    shared = graph.listen(TFMessage, "/tf")
    with (
        Simulator(link=tmp_path / "left") as left,
        Simulator(link=tmp_path / "right") as right,
        RobotNode(graph, namespace="/left", port=left.port, tf_frame_prefix="left"),
        RobotNode(graph, namespace="/right", port=right.port, tf_frame_prefix="right/"),
    ):
        with Repeater(graph.publisher(Twist, "/left/cmd_vel"), lambda: twist(SPEED_MPS)):
            wait(lambda: left_odometry and left_odometry[-1].pose.pose.position.x > 0.1, "10 cm")
        wait(lambda: right_odometry, "/right/odom")
        assert right.get("true.distance_m") == 0
        assert right_odometry[-1].pose.pose.position.x == 0
        assert left_odometry[-1].header.frame_id == "left/odom"
        assert right_odometry[-1].child_frame_id == "right/base_link"
        # robot_state_publisher finds them in the model, whose joints have no prefix.
        assert set(graph.first(JointState, "/left/joint_states").name) == model_joints()
        assert graph.call(SetBool, "/right/hardware_robot/estop", data=True).success
        assert right.get("state") == SupervisorState.ESTOPPED
        assert left.get("state") != SupervisorState.ESTOPPED
        link = Diagnostics(graph, "left/hardware_robot").wait("link", lambda *_: True)
        assert link["port"] == left.port
        assert health(graph, "left/hardware_robot") == 0
        both = {("left/odom", "left/base_link"), ("right/odom", "right/base_link")}
        wait(lambda: edges(shared) >= both, "both robots' transforms")
    assert edges(shared) == both


def test_in_a_namespace_each_has_a_tf_of_its_own(graph: Graph, tmp_path: Path) -> None:
    shared, own = (graph.listen(TFMessage, topic) for topic in ("/tf", "/left/tf"))
    remappings = started(load(LAUNCH), namespace="left")["hardware_robot"].remappings
    with (
        Simulator(link=tmp_path / "left") as left,
        RobotNode(graph, namespace="/left", port=left.port, remappings=remappings),
    ):
        wait(lambda: edges(own) == {("odom", "base_link")}, "/left/tf")
    assert not shared


def edges(messages: Iterable[Any]) -> set[tuple[str, str]]:
    """The frames that the transforms connect."""
    return {
        (transform.header.frame_id, transform.child_frame_id)
        for message in tuple(messages)
        for transform in message.transforms
    }


def is_said(node: RobotNode) -> bool:
    return "another node has this node's name" in node.errors()


def test_a_second_node_of_the_name_is_reported_and_a_killed_one_is_not(graph: Graph) -> None:
    # Half a minute of messages that nobody reads would take processor time.
    mock: dict[str, Any] = {"driver_type": "mock", "publish_rate": 1.0, "imu_rate": 1.0}
    diagnostics = Diagnostics(graph)
    with RobotNode(graph, **mock) as killed:
        graph.wait_active()
        killed.end(signal.SIGKILL)
    with RobotNode(graph, **mock) as first:
        with RobotNode(graph, **mock) as second:
            diagnostics.wait("name", lambda status, _: status.level == DiagnosticStatus.ERROR)
            for node in (first, second):
                wait(partial(is_said, node), "a line")
        with RobotNode(graph, namespace="/other", **mock) as elsewhere:
            Diagnostics(graph, "other/hardware_robot").wait("link", lambda *_: True)
            assert not is_said(elsewhere)
