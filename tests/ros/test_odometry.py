"""odom, /tf and joint_states: against the plant, without samples, and by the clock."""

from __future__ import annotations

import math
import signal
import time
from collections import deque
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
pytest.importorskip("tf2_msgs.msg", reason="`make ros` builds tf2_msgs")

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import BatteryState, JointState
from std_srvs.srv import SetBool
from tf2_msgs.msg import TFMessage

from support import stop_host
from support.ros import Diagnostics, Graph, Repeater, wait
from support.ros_filter import FilterNode
from support.ros_process import RobotNode
from support.ros_rig import (
    NODE,
    SPEED_MPS,
    Rig,
    State,
    is_measured,
    open_rig,
    stamp_s,
    stamped_after,
    stands,
    twist,
)
from support.stop_host import stopped
from wheelwire.simulation.simulator import Simulator
from wheelwire_ros.motion_estimator import HELD_MPS
from wheelwire_ros.reader import SILENCE_S

PERIOD_S = 0.02
RECENT_S = 5.0
LONG: dict[str, Any] = {"cmd_vel_timeout": 5.0, "ttl_max_s": 5.0}
"""On a busy computer a command may take longer than half a second to the robot."""
NAMES = ["left_wheel_joint", "right_wheel_joint"]
LOST_S = 3.0
OFF_M = 0.1
RATE_HZ = 50.0
FREEZE_S = 0.15
START_S = 100


def heading_rad(odometry: Any) -> float:
    orientation = odometry.pose.pose.orientation
    return 2 * math.atan2(orientation.z, orientation.w)


def turned_rad(angle_rad: float) -> float:
    """The same angle, from -pi to pi."""
    return (angle_rad + math.pi) % math.tau - math.pi


def test_odom_is_where_the_robot_is(graph: Graph, simulator: Simulator) -> None:
    odometry = graph.listen(Odometry, "odom")
    joints = graph.listen(JointState, "joint_states")
    transforms = graph.listen(TFMessage, "/tf")
    diagnostics = Diagnostics(graph)
    with RobotNode(graph, port=simulator.port, base_frame_id="base_footprint", **LONG):
        publisher = graph.publisher(Twist, "cmd_vel")
        wait(lambda: odometry, "odom")

        def halts() -> bool:
            publisher.publish(Twist())
            return stands(odometry)

        for command in (twist(0.3, 1.5), twist(-0.2, 0.7)):
            with Repeater(publisher, lambda: command):  # noqa: B023 - ended before the next
                time.sleep(1.5)
        wait(halts, "the robot's halt")
        end = odometry[-1]
        check_pose(end, simulator)
        check_stamps(graph, odometry)
        check_joints(joints, simulator)
        check_transforms(transforms, odometry)
        link = diagnostics.wait("link", lambda s, _: s.level == DiagnosticStatus.OK)
        assert (link["driver"], link["port"]) == ("serial", simulator.port)
        assert float(link["round_trip_p50_us"]) > 0
        assert float(link["sample_time_error_s"]) < 0.01
        assert link["device_resets"] == link["frames_lost"] == "0"
        obeyed = diagnostics.wait("commands", lambda _, v: int(v["obeyed"]) > 0)
        assert obeyed["ignored"] == "0"
        battery = graph.first(BatteryState, "battery_state")
        assert battery.voltage == pytest.approx(7.4, abs=0.1)
        assert math.isnan(battery.percentage)  # nobody has told the cells


def check_pose(message: Any, simulator: Simulator) -> None:
    """Odometry against truth: the ticks' resolution."""
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_footprint")
    position = message.pose.pose.position
    true = simulator.get("true.x_m"), simulator.get("true.y_m"), simulator.get("true.heading_rad")
    assert (position.x, position.y) == pytest.approx(true[:2], abs=0.01)
    assert turned_rad(heading_rad(message) - true[2]) == pytest.approx(0, abs=0.02)
    assert math.hypot(position.x, position.y) > 0.1
    covariance = message.pose.covariance
    assert 0 < covariance[0] < 0.01
    assert 0 < covariance[35] < 0.1


def check_stamps(graph: Graph, odometry: deque[Any]) -> None:
    """Device times, at the rate asked for, and in the past of the clock that reads them."""
    stamps = [m.header.stamp.sec + m.header.stamp.nanosec / 1e9 for m in tuple(odometry)]
    steps = [b - a for a, b in pairwise(stamps)]
    assert min(steps) > 0
    assert sorted(steps)[len(steps) // 2] == pytest.approx(0.02, rel=0.05)
    now = graph.now_s()
    assert now - RECENT_S < stamps[-1] < now + 0.01


def check_joints(joints: deque[Any], simulator: Simulator) -> None:
    message = joints[-1]
    assert message.name == NAMES
    turns = simulator.get("true.left_ticks") / 360, simulator.get("true.right_ticks") / 360
    assert [a / math.tau for a in message.position] == pytest.approx(turns, abs=0.01)


def check_transforms(transforms: deque[Any], odometry: deque[Any]) -> None:
    """Each is the pose of odom at its time."""
    poses = {(m.header.stamp.sec, m.header.stamp.nanosec): m for m in tuple(odometry)}
    compared = 0
    for message in tuple(transforms):
        (transform,) = message.transforms
        header = transform.header
        same = poses.get((header.stamp.sec, header.stamp.nanosec))
        if same is not None:
            compared += 1
            assert (header.frame_id, transform.child_frame_id) == ("odom", "base_footprint")
            assert transform.transform.translation.x == same.pose.pose.position.x
            assert transform.transform.rotation == same.pose.pose.orientation
    assert compared > 10


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with open_rig(tmp_path) as rig:
        yield rig


def error_m(rig: Rig, judge: FilterNode) -> float:
    x_m, y_m, _ = judge.place
    return math.hypot(x_m - rig.simulator.get("true.x_m"), y_m - rig.simulator.get("true.y_m"))


def drive(rig: Rig) -> None:
    rig.truth(lambda state: state.x_m > 0.5)


def test_the_link_is_lost_for_three_seconds(rig: Rig) -> None:
    """odom goes on; /tf and joint_states do not pretend to be fresh."""
    state, judge = State(rig.graph), FilterNode(rig.graph)
    transforms = rig.graph.listen(TFMessage, "/tf")
    joints = rig.graph.listen(JointState, "joint_states")
    with rig.driving():
        drive(rig)
        rig.simulator.unplug()
        begin_s = rig.wait_past(LOST_S)
        lost_m = error_m(rig, judge)
        state.wait(lambda values: values["odom"] == "held")
        held = stamped_after(rig.odometry, begin_s + 1.0)
        for stamps_s in (
            [stamp_s(message.transforms[0]) for message in tuple(transforms)],
            [stamp_s(message) for message in tuple(joints)],
        ):
            assert all(a < b for a, b in pairwise(stamps_s))
            assert stamps_s[-1] < begin_s + SILENCE_S
    rig.truth(stopped)
    assert lost_m < OFF_M
    rig.simulator.plug()
    state.wait(lambda values: values["odom"] == "measured")
    # odom went on with the last pose, no velocity, and less and less knowledge.
    last = held[-1]
    rate_hz = (len(held) - 1) / (stamp_s(last) - stamp_s(held[0]))
    assert rate_hz == pytest.approx(RATE_HZ, rel=0.25)
    assert len({one.pose.pose.position.x for one in held}) == 1
    assert all(one.twist.twist.linear.x == one.twist.twist.angular.z == 0 for one in held)
    assert all(a.pose.covariance[0] < b.pose.covariance[0] for a, b in pairwise(held))
    assert math.sqrt(last.pose.covariance[0]) > SPEED_MPS * 2
    assert last.twist.covariance[0] >= HELD_MPS**2
    check_order(rig)


def check_order(rig: Rig) -> None:
    """Time never runs backward in odom."""
    assert all(stamp_s(a) < stamp_s(b) for a, b in pairwise(tuple(rig.odometry)))


def wait_for_more(odometry: deque[Any]) -> None:
    seen = len(odometry)
    wait(lambda: len(odometry) > seen + 10, "odom")


def test_after_short_freezes_no_sample_is_missing(tmp_path: Path) -> None:
    """Unless the node counts it."""

    def counted(rig: Rig) -> tuple[int, int]:
        """Samples that it has published, and those that it knows are missing."""
        link = rig.diagnostics.wait("link", lambda status, _: status.level == DiagnosticStatus.OK)
        lost = int(link["samples_dropped"]) + int(link["frames_lost"])
        return int(link["samples_published"]), lost

    def samples(messages: deque[Any]) -> list[float]:
        """Their times; on a busy computer the node may take a freeze for a silence."""
        return [stamp_s(message) for message in tuple(messages) if is_measured(message)]

    def missing(stamps: list[float]) -> int:
        return sum(round((later - earlier) / PERIOD_S) - 1 for earlier, later in pairwise(stamps))

    with open_rig(tmp_path) as rig:
        _, before = counted(rig)
        odometry = rig.graph.listen(Odometry, "odom")
        for _ in range(10):
            rig.node.process.send_signal(signal.SIGSTOP)
            time.sleep(FREEZE_S)
            rig.node.process.send_signal(signal.SIGCONT)
            wait_for_more(odometry)
        frozen = samples(odometry)
        published, after = counted(rig)
        assert published >= len(frozen)
        wait_for_more(rig.odometry)
        # The counts are of more than the freezes, and all that came is of more than the counts.
        assert missing(frozen) <= after - before <= missing(samples(rig.odometry))


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
