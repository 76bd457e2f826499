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
from support.ros import TIMEOUT_S, Diagnostics, Graph, Repeater, wait
from support.ros_filter import FilterNode
from support.ros_process import RobotNode
from support.ros_rig import NODE, SPEED_MPS, Rig, State, open_rig, stamp_s, stamped_after, twist
from support.stop_host import stopped
from wheelwire.simulation.simulator import Simulator
from wheelwire_ros.motion_estimator import HELD_MPS
from wheelwire_ros.reader import SILENCE_S

SIDE_M = 0.2
CORNERS_M = ((SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M), (0.0, 0.0))
ARRIVED_M = 0.02
TURN_RADPS = 2.0
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


class Driver:
    """Looks at nothing but odom."""

    def __init__(self, odometry: deque[Any], publisher: Any) -> None:
        self._odometry = odometry
        self._publisher = publisher

    def go_to(self, x_m: float, y_m: float) -> None:
        end = time.monotonic() + TIMEOUT_S
        while not self._step_to(x_m, y_m):
            assert time.monotonic() < end, f"({x_m}, {y_m}) was not reached"
            time.sleep(PERIOD_S)

    def halt_at(self, x_m: float, y_m: float) -> None:
        """Drive back as long as the robot stands elsewhere, because the stop came late."""
        end = time.monotonic() + TIMEOUT_S
        while True:
            self.go_to(x_m, y_m)
            wait(self._stands, "the robot's halt")
            position = self._odometry[-1].pose.pose.position
            if math.hypot(x_m - position.x, y_m - position.y) < 2 * ARRIVED_M:
                return
            assert time.monotonic() < end, f"it did not halt at ({x_m}, {y_m})"

    def _step_to(self, x_m: float, y_m: float) -> bool:
        """Command once, turning towards the goal before driving; whether it is reached."""
        newest = self._odometry[-1]
        position = newest.pose.pose.position
        away = x_m - position.x, y_m - position.y
        error = turned_rad(math.atan2(away[1], away[0]) - heading_rad(newest))
        linear = SPEED_MPS * max(0.0, math.cos(error)) ** 8
        angular = max(-TURN_RADPS, min(TURN_RADPS, 6 * error))
        self._publisher.publish(twist(linear, angular))
        return math.hypot(*away) < ARRIVED_M

    def _stands(self) -> bool:
        self._publisher.publish(Twist())
        twist = self._odometry[-1].twist.twist
        return bool(twist.linear.x == twist.angular.z == 0)


def test_a_square(graph: Graph, simulator: Simulator) -> None:
    odometry = graph.listen(Odometry, "odom")
    joints = graph.listen(JointState, "joint_states")
    transforms = graph.listen(TFMessage, "/tf")
    diagnostics = Diagnostics(graph)
    with RobotNode(graph, port=simulator.port, base_frame_id="base_footprint", **LONG):
        publisher = graph.publisher(Twist, "cmd_vel")
        wait(lambda: odometry, "odom")
        driver = Driver(odometry, publisher)
        for corner in CORNERS_M:
            driver.go_to(*corner)
        driver.halt_at(*CORNERS_M[-1])
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
    """Odometry against truth: the ticks' resolution, and a loop that begins where it ends."""
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_footprint")
    position = message.pose.pose.position
    true = simulator.get("true.x_m"), simulator.get("true.y_m"), simulator.get("true.heading_rad")
    assert (position.x, position.y) == pytest.approx(true[:2], abs=0.01)
    assert turned_rad(heading_rad(message) - true[2]) == pytest.approx(0, abs=0.02)
    assert math.hypot(position.x, position.y) < 2 * ARRIVED_M
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


def test_the_device_is_reset(rig: Rig) -> None:
    judge = FilterNode(rig.graph)
    with rig.driving():
        drive(rig)
        boot_id = rig.simulator.reset()
        rig.truth(lambda state: state.boot_id == boot_id)
        rig.truth(stopped)
        rig.wait_past(1.0)
        assert error_m(rig, judge) < OFF_M
    check_order(rig)


def check_order(rig: Rig) -> None:
    """Time never runs backward in odom."""
    assert all(stamp_s(a) < stamp_s(b) for a, b in pairwise(tuple(rig.odometry)))


def wait_for_more(odometry: deque[Any]) -> None:
    seen = len(odometry)
    wait(lambda: len(odometry) > seen + 10, "odom")


def test_after_short_freezes_no_sample_is_missing(tmp_path: Path) -> None:
    with open_rig(tmp_path) as rig:
        rig.odometry.clear()
        for _ in range(10):
            rig.node.process.send_signal(signal.SIGSTOP)
            time.sleep(FREEZE_S)
            rig.node.process.send_signal(signal.SIGCONT)
            wait_for_more(rig.odometry)
        # Before the report, which then counts all of them.
        stamps = [stamp_s(message) for message in tuple(rig.odometry)]
        link = rig.diagnostics.wait("link", lambda status, _: status.level == DiagnosticStatus.OK)
    steps = [later - earlier for earlier, later in pairwise(stamps)]
    missing = sum(round(step / PERIOD_S) - 1 for step in steps)
    assert missing == int(link["samples_dropped"]) + int(link["frames_lost"])
    assert int(link["samples_published"]) >= len(stamps)


def test_a_freeze_is_no_fault_of_the_mocks(graph: Graph) -> None:
    diagnostics = Diagnostics(graph)
    odometry = graph.listen(Odometry, "odom")
    with RobotNode(graph, driver_type="mock") as node:
        graph.wait_active()
        for _ in range(3):
            node.process.send_signal(signal.SIGSTOP)
            time.sleep(FREEZE_S)
            node.process.send_signal(signal.SIGCONT)
            wait_for_more(odometry)
        robot = diagnostics.wait("robot", lambda *_: True)
    assert (robot["state"], robot["faults"]) == ("IDLE", "")


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
