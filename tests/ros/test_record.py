"""The robot's day in a recording, and another node that replays it, bit by bit."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from lifecycle_msgs.msg import Transition
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, JointState
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from support.ros import Diagnostics, Graph, Repeater, open_graph, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, SPEED_MPS, Rig, open_rig, stands, twist
from support.stop_host import stopped
from wheelwire.connect import RECORD_VARIABLE
from wheelwire.log.reader import is_complete, metadata, records
from wheelwire.log.rerun import Rerun
from wheelwire.motion.kinematics import DifferentialDrive
from wheelwire.motion.odometry import Odometry as Poses
from wheelwire_ros.publishers import time_ns


def drive(graph: Graph, node: RobotNode) -> float:
    """Some centimetres, to a halt, and the node's end; how far, by odom."""
    odometry = graph.listen(Odometry, "odom")
    commands = graph.publisher(Twist, "cmd_vel")
    wait(lambda: odometry, "odom")
    with Repeater(commands, lambda: twist(SPEED_MPS)):
        wait(lambda: odometry[-1].pose.pose.position.x > 0.05, "5 cm")
    wait(lambda: stands(odometry), "the halt")
    assert node.end(signal.SIGINT) == 0
    return float(odometry[-1].pose.pose.position.x)


def test_a_folder_gets_the_robots_day(graph: Graph, tmp_path: Path) -> None:
    with RobotNode(graph, driver_type="mock", record=str(tmp_path)) as node:
        driven_m = drive(graph, node)
    (file,) = tmp_path.glob("wheelwire-*.mcap")
    assert is_complete(file)
    assert metadata(file)["driver"] == "mock"
    again = Rerun()
    samples = [one.sample() for one in again.feed_all(records(file))]
    assert again.session is not None
    poses = Poses(DifferentialDrive.of_device(again.session.reported.values))
    for sample in samples:
        poses.update(sample)
    assert poses.pose.x_m == pytest.approx(driven_m, abs=0.002)


TOPICS = {"odom": Odometry, "joint_states": JointState, "tf": TFMessage}
DEPTH = 1000


class Heard:
    """The bytes of each message on the topics, by topic and stamp."""

    def __init__(self, graph: Graph) -> None:
        self.messages: dict[tuple[str, int], bytes] = {}
        for name, type_ in TOPICS.items():
            graph.node.create_subscription(type_, name, self._note(name, type_), DEPTH, raw=True)
        self.imu = graph.listen(Imu, "imu/data_raw")
        self._graph = graph

    def _note(self, name: str, type_: Any) -> Any:
        def note(data: bytes) -> None:
            message = deserialize_message(data, type_)
            header = message.transforms[0].header if name == "tf" else message.header
            self.messages[name, time_ns(header.stamp)] = data

        return note

    def wait_for_publishers(self) -> None:
        wait(lambda: all(map(self._graph.node.count_publishers, TOPICS)), "publishers")
        time.sleep(1.0)  # until they know of the subscribers

    def wait_for_the_rest(self) -> None:
        """Until nothing has come for a second."""
        count = -1
        while count != len(self.messages):
            count = len(self.messages)
            time.sleep(1.0)


def drive_a_bend_and_back(rig: Rig) -> None:
    with Repeater(rig.commands, lambda: twist(0.3, 1.5)):
        wait(lambda: rig.x_m() > 0.1, "a stretch of the way")
    with Repeater(rig.commands, lambda: twist(-0.2, 0.7)):
        rig.truth(lambda state: state.left_mps < -0.1)
    rig.truth(stopped)


def set_pose_and_go_on(rig: Rig) -> None:
    """The pose is set from outside twice, while the robot drives."""
    poses = rig.graph.publisher(PoseWithCovarianceStamped, f"{NODE}/set_pose")
    message = PoseWithCovarianceStamped()
    message.pose.pose.position.x, message.pose.pose.orientation.w = 7.0, 1.0
    with Repeater(rig.commands, lambda: twist(0.2, -0.5)):
        rig.truth(lambda state: state.left_mps > 0.1)
        poses.publish(message)
        wait(lambda: rig.x_m() > 6, "the pose that was set")
        assert rig.graph.call(Trigger, f"{NODE}/reset_odometry").success
        wait(lambda: 0.05 < rig.x_m() < 1, "a stretch from the origin")
    rig.truth(stopped)


def test_a_recorded_day_replays_bit_by_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "day.mcap"
    with monkeypatch.context() as patch:
        patch.setenv(RECORD_VARIABLE, str(file))
        with open_rig(tmp_path, line="noisy", max_rpm=100.0) as rig:
            day = Heard(rig.graph)
            wait(lambda: len(day.messages) > 30, "messages")
            drive_a_bend_and_back(rig)
            set_pose_and_go_on(rig)
    assert len(day.messages) > 300
    for speed in (1.0, 0.0):
        again = replayed(file, speed)
        common = day.messages.keys() & again.keys()
        assert len(common) > len(day.messages) / 2  # DDS drops some on a busy computer
        assert {key: again[key] for key in common} == {key: day.messages[key] for key in common}


def replayed(file: Path, speed: float) -> dict[tuple[str, int], bytes]:
    with (
        open_graph() as graph,
        RobotNode(
            graph,
            driver_type="replay",
            replay_file=str(file),
            replay_speed=speed,
            max_rpm=100.0,
            autostart=False,
        ),
    ):
        heard, diagnostics = Heard(graph), Diagnostics(graph)
        assert graph.change_state(NODE, Transition.TRANSITION_CONFIGURE)
        heard.wait_for_publishers()
        assert graph.change_state(NODE, Transition.TRANSITION_ACTIVATE)
        wait(lambda: heard.messages, "messages")
        # It stays, and says why nothing comes any more.
        diagnostics.wait("link", lambda status, _: "ended" in status.message)
        heard.wait_for_the_rest()
        assert heard.imu
        return heard.messages
