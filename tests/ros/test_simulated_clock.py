"""use_sim_time: the node waits for /clock, says so, and still drives."""

from __future__ import annotations

import time
from itertools import pairwise
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool

from support import stop_host
from support.ros import Diagnostics, Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, SPEED_MPS, stamp_s, twist
from support.stop_host import stopped
from wheelwire.simulation.simulator import Simulator

START_S = 100


def test_it_waits_for_the_clock_and_obeys_meanwhile(graph: Graph, tmp_path: Path) -> None:
    odometry, joints = graph.listen(Odometry, "odom"), graph.listen(JointState, "joint_states")
    diagnostics = Diagnostics(graph)
    with (
        Simulator(link=tmp_path / "port", truth_hz=200.0) as simulator,
        RobotNode(graph, port=simulator.port, use_sim_time=True) as node,
    ):
        diagnostics.wait(
            "clock",
            lambda status, _: status.level == DiagnosticStatus.WARN and "/clock" in status.message,
        )
        wait(lambda: "waiting for /clock" in node.errors(), "a line in the log")
        with Repeater(graph.publisher(Twist, "cmd_vel"), lambda: twist(SPEED_MPS)):
            stop_host.wait(simulator, lambda state: state.drive_on)
            assert graph.call(SetBool, f"{NODE}/estop", data=True).success
            stop_host.wait(simulator, stopped)
        assert not odometry
        assert not joints

        clock = graph.publisher(Clock, "/clock")
        time_s = iter(range(START_S, 10**9))
        with Repeater(clock, lambda: Clock(clock=Time(sec=next(time_s))), rate_hz=10):
            wait(lambda: odometry and joints, "motion")
            diagnostics.wait("link", lambda status, _: status.level == DiagnosticStatus.OK)
        assert stamp_s(odometry[0]) > START_S - 1
        assert stamp_s(joints[0]) > START_S - 1
        assert node.errors().count("waiting for /clock") == 1


def test_stamps_follow_a_clock_of_another_speed(graph: Graph, simulator: Simulator) -> None:
    """Up to its last step, which is where a subscriber's own clock stands."""
    speed = 0.5
    late_s: list[float] = []
    stamps_s: list[float] = []
    clock_s = [0.0]
    begin_s = time.monotonic()

    def tick() -> Clock:
        clock_s[0] = START_S + speed * (time.monotonic() - begin_s)
        return Clock(clock=Time(sec=int(clock_s[0]), nanosec=int(clock_s[0] % 1 * 1e9)))

    def take(message: Odometry) -> None:
        stamps_s.append(stamp_s(message))
        late_s.append(clock_s[0] - stamps_s[-1])

    with RobotNode(graph, port=simulator.port, use_sim_time=True):
        graph.wait_active()
        with Repeater(graph.publisher(Clock, "/clock"), tick, rate_hz=20):
            graph.node.create_subscription(Odometry, "odom", take, 100)
            wait(lambda: late_s, "odom")
            time.sleep(3.0)  # it knows the speed
            seen = len(late_s)
            wait(lambda: len(late_s) > seen + 100, "odom by that clock")
    late_s = late_s[seen:]
    # A quarter of them: the two processes share the computer with others.
    assert sorted(late_s)[len(late_s) * 3 // 4] < 0.1 * speed + 0.05
    assert all(b > a for a, b in pairwise(stamps_s))
