"""The load of a node in a separate process, compared with a minimal rclpy node."""

from __future__ import annotations

import json
import random
import signal
import time
from contextlib import ExitStack, closing, nullcontext
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from std_srvs.srv import SetBool

from support import stop_host
from support.attached import holder_of
from support.command import output
from support.processes import cpu_s
from support.ros import Graph, Repeater, wait
from support.ros_process import RobotNode
from support.stand_in import StandIn
from wheelwire.drivers.attached import AttachedDriver
from wheelwire.link.sample_stream import LatestSample
from wheelwire.link.statistics import quantile
from wheelwire.log.share.attached_link import AttachedLink
from wheelwire.simulation.simulator import Simulator, TrueState
from wheelwire_protocol.codes import SupervisorState

PAUSE_S = 0.015
"""Time between commands, plus up to as much at random, to meet every phase of periodic work."""
COMMANDS_HZ = 100.0
FIRST_MPS, STEP_MPS = 0.2, 0.0001
"""Velocities of commands that differ by a step each."""
DRIVEN_S = 0.4
"""A command that has not driven a motor by then was refused: it is valid for half a second."""
WATCH_S = 3.0

BARE_NODE = """
import json, time
from pathlib import Path
import rclpy
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from rclpy.executors import ExternalShutdownException
from sensor_msgs.msg import Imu, JointState
from tf2_msgs.msg import TFMessage

seen = {{}}
covariance = [0.001] * 36
rclpy.init()
node = rclpy.create_node("bare")
publishers = [
    node.create_publisher(type_, "bare_" + name, 100)
    for type_, name in ((Odometry, "odom"), (JointState, "joints"), (TFMessage, "tf"), (Imu, "imu"))
]

def publish():
    odom, joints, imu, transform = Odometry(), JointState(), Imu(), TransformStamped()
    for message in (odom, joints, imu, transform):
        message.header.stamp = node.get_clock().now().to_msg()
        message.header.frame_id = "odom"
    odom.child_frame_id = transform.child_frame_id = "base_link"
    odom.pose.pose.position.x = transform.transform.translation.x = 0.1
    odom.pose.pose.orientation.z = transform.transform.rotation.z = 0.2
    odom.twist.twist.linear.x = odom.twist.twist.angular.z = 0.3
    odom.pose.covariance = odom.twist.covariance = covariance
    joints.name = ["left_wheel_joint", "right_wheel_joint"]
    joints.position = joints.velocity = [0.4, 0.5]
    imu.angular_velocity.z = imu.linear_acceleration.z = 0.6
    imu.angular_velocity_covariance = imu.linear_acceleration_covariance = covariance[:9]
    messages = odom, joints, TFMessage(transforms=[transform]), imu
    for publisher, message in zip(publishers, messages):
        publisher.publish(message)

def hear(twist):
    seen[twist.linear.y] = time.monotonic()

node.create_timer(1 / {rate_hz}, publish)
node.create_subscription(Twist, "bare_cmd_vel", hear, 1)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException, RuntimeError):
    pass  # rclpy makes a RuntimeError of a signal that comes while it converts a message
Path("{file}").write_text(json.dumps(seen))
"""
"""A node that ignores the Twists it receives, and by a timer publishes what a robot's node does at
its rate, built as ROS's tutorials build messages."""

BARE_SERVICE = """
import json, time
from pathlib import Path
import rclpy
from rclpy.executors import ExternalShutdownException
from std_srvs.srv import SetBool

called = []
rclpy.init()
node = rclpy.create_node("bare_service")

def serve(request, response):
    called.append(time.monotonic())
    response.success = True
    return response

node.create_service(SetBool, "bare_estop", serve)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException, RuntimeError):
    pass  # as in the bare node
Path("{file}").write_text(json.dumps(called))
"""
"""A node with nothing but a service, which does nothing."""

FLOOD = """
import rclpy
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, ListParameters, SetParameters
from rclpy.executors import ExternalShutdownException
from std_srvs.srv import Trigger

rclpy.init()
node = rclpy.create_node("flood")
name = "/hardware_robot/"
clients = [
    node.create_client(type_, name + service)
    for type_, service in (
        (SetParameters, "set_parameters"),
        (ListParameters, "list_parameters"),
        (DescribeParameters, "describe_parameters"),
        (Trigger, "save_parameters"),
    )
]
gain = Parameter(name="integral_gain", value=ParameterValue(type=3, double_value=16.0))
requests = [
    SetParameters.Request(parameters=[gain]),
    ListParameters.Request(),
    DescribeParameters.Request(names=["integral_gain", "publish_rate", "wheel_radius"] * 10),
    Trigger.Request(),
]

def ask(client, request):
    client.call_async(request).add_done_callback(lambda _: ask(client, request))

for client, request in zip(clients, requests):
    client.wait_for_service()
    ask(client, request)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException):
    pass
"""
"""A client that asks for parameters, sets one and saves, each again as soon as it is answered."""


class RobotCommander:
    """Publishes commands, no two equal, through a node to a robot.

    Args:
        graph: Of the client.
        tap: The node's port, a `support.wire_tap`.
    """

    def __init__(self, graph: Graph, tap: StandIn) -> None:
        self._publisher = graph.publisher(Twist, "cmd_vel")
        self._tap = tap
        self._published_s: list[float] = []

    def send(self, count: int) -> None:
        """Publish commands one after the other."""
        for _ in range(count):
            time.sleep(_pause_s())
            number = len(self._published_s)
            self._published_s.append(time.monotonic())
            self._publisher.publish(Twist(linear=Vector3(x=FIRST_MPS + number * STEP_MPS)))

    def latencies_s(self, skipped: int) -> list[float]:
        """Latencies of all commands that reached the port, except the first `skipped`."""
        asked_s = self._tap.command("asked")
        found = []
        for number, published_s in list(enumerate(self._published_s))[skipped:]:
            reached_s = asked_s.get(str(round((FIRST_MPS + number * STEP_MPS) * 1e6)))
            if reached_s is not None:
                found.append(reached_s - published_s)
        return found


class Commander:
    """Publishes numbered commands, and knows when.

    Args:
        graph: Of the client.
        topic: Somebody subscribes to it.
        file: Where the subscriber writes, at its end, when it saw which.
    """

    def __init__(self, graph: Graph, topic: str, file: Path) -> None:
        self._publisher = graph.publisher(Twist, topic)
        self._file = file
        self._published_s: list[float] = []

    def send(self, count: int) -> None:
        """Publish commands one after the other."""
        for _ in range(count):
            time.sleep(_pause_s())
            number = Vector3(x=0.2, y=float(len(self._published_s)))
            self._published_s.append(time.monotonic())
            self._publisher.publish(Twist(linear=number))

    def latencies_s(self, skipped: int) -> list[float]:
        """Latencies of all commands seen, except the first `skipped`."""
        seen = {int(float(n)): s for n, s in json.loads(self._file.read_text()).items()}
        return [s - self._published_s[n] for n, s in seen.items() if n >= skipped]


def _pause_s() -> float:
    """Between commands, at random, to meet every phase of periodic work."""
    return (0.5 + random.random()) / COMMANDS_HZ


class MotorLatencies(NamedTuple):
    """In seconds, one after the other."""

    commands_s: list[float]
    """From the publication of cmd_vel until a motor is driven."""
    estops_s: list[float]
    """From the call of ~/estop until none is."""
    peer_s: list[float]
    """From the call of a service of a bare node to its callback."""


def latencies_to_the_motors(
    graph: Graph, simulator: Simulator, count: int, file: Path, *, flooded: bool
) -> MotorLatencies:
    """Latencies of commands and e-stops, by the simulated robot's report; and of a bare service.

    Args:
        graph: Of the client.
        simulator: The node's robot.
        count: Of each.
        file: For the bare node.
        flooded: Whether another client asks the node without a pause.
    """
    commands = graph.publisher(Twist, "cmd_vel")
    estop = graph.node.create_client(SetBool, "/hardware_robot/estop")
    peer = graph.node.create_client(SetBool, "bare_estop")
    wait(estop.service_is_ready, "~/estop")
    graph.wait_active()
    driven_s: list[float] = []
    stopped_s: list[float] = []
    called_s: list[float] = []
    with (
        RobotNode(graph, BARE_SERVICE.format(file=file)) as bare,
        RobotNode(graph, FLOOD) if flooded else nullcontext(),
    ):
        wait(peer.service_is_ready, "the bare service")
        while len(stopped_s) < count:
            time.sleep(PAUSE_S * (1 + random.random()))
            simulator.take_states()
            begin_s = time.monotonic()
            commands.publish(Twist(linear=Vector3(x=0.2)))
            on = _driven(simulator)
            if on is None:  # it came before the first state without the e-stop, and was ignored
                continue
            driven_s.append(on.host_us / 1e6 - begin_s)
            begin_s = time.monotonic()
            answer = estop.call_async(SetBool.Request(data=True))
            off = stop_host.wait(simulator, lambda state: not state.drive_on)
            stopped_s.append(off.host_us / 1e6 - begin_s)
            wait(answer.done, "the answer of ~/estop")
            cleared = estop.call_async(SetBool.Request(data=False))
            wait(cleared.done, "the end of the e-stop")
            _arm(simulator, commands)
            called_s.append(time.monotonic())
            wait(peer.call_async(SetBool.Request()).done, "the answer of the bare service")
        bare.end(signal.SIGINT)  # then its file is there
    arrived_s = json.loads(file.read_text())
    peer_s = [arrived - called for called, arrived in zip(called_s, arrived_s, strict=True)]
    return MotorLatencies(driven_s, stopped_s, peer_s)


class AttachedEstops(NamedTuple):
    """Latencies of e-stops beside a node, in seconds."""

    written_s: list[float]
    """From the write to the socket of the node's tap until it is on the wire."""
    commands_s: list[float]
    """From the start of the command `wheelwire estop`."""


def attached_estops(
    graph: Graph, simulator: Simulator, tap: StandIn, counts: tuple[int, int], listeners: int
) -> AttachedEstops:
    """Latencies of e-stops by programs that are attached to a node which drives.

    Args:
        graph: Of the client.
        simulator: The node's robot.
        tap: The node's port, a `support.wire_tap`.
        counts: How many of each kind.
        listeners: How many others are attached, and take all that crosses the link.
    """
    port = tap.first_answer["port"]
    commands = graph.publisher(Twist, "cmd_vel")
    estop = graph.node.create_client(SetBool, "/hardware_robot/estop")
    wait(estop.service_is_ready, "~/estop")

    def write() -> None:
        link = AttachedLink(LatestSample(), holder_of(port), listens=False)
        link.open()
        with closing(link):
            begun_s.append(time.monotonic())
            link.estop()

    def command() -> None:
        begun_s.append(time.monotonic())
        output("estop", port)

    found: list[list[float]] = []
    with ExitStack() as stack:
        for _ in range(listeners):
            stack.enter_context(AttachedDriver(holder_of(port)))
        for act, count in zip((write, command), counts, strict=True):
            begun_s: list[float] = []
            latencies_s: list[float] = []
            for _ in range(count):
                _arm(simulator, commands)
                with Repeater(commands, lambda: Twist(linear=Vector3(x=0.2)), COMMANDS_HZ):
                    stop_host.wait(simulator, lambda state: state.drive_on)
                    time.sleep(PAUSE_S * (1 + random.random()))
                    act()
                arrived_s = tap.command("estops")["estops_s"]
                latencies_s.append(min(s for s in arrived_s if s >= begun_s[-1]) - begun_s[-1])
                cleared = estop.call_async(SetBool.Request(data=False))
                wait(cleared.done, "the end of the e-stop")
            found.append(latencies_s)
    return AttachedEstops(*found)


def _arm(simulator: Simulator, commands: Any) -> None:
    """Command standstill after a clear, until the robot obeys: before that nothing drives."""
    simulator.take_states()
    with Repeater(commands, Twist):
        stop_host.wait(simulator, lambda state: state.state is SupervisorState.DRIVING)


def _driven(simulator: Simulator) -> TrueState | None:
    """The first state with a driven motor, if there is one soon."""
    end_s = time.monotonic() + DRIVEN_S
    while time.monotonic() < end_s:
        for state in simulator.take_states():
            if state.drive_on:
                return state
        time.sleep(0.001)
    return None


@dataclass(frozen=True)
class Stream:
    """The messages of a topic that arrived at a subscriber in another process.

    Attributes:
        rate_hz: Messages a second.
        arrival_jitter_s: p99 of the difference between an interval of arrivals and the period.
        stamp_jitter_s: The same of the stamps.
        cpu: Of the publisher's process, of one core.
    """

    rate_hz: float
    arrival_jitter_s: float
    stamp_jitter_s: float
    cpu: float


def watch(graph: Graph, topic: str, rate_hz: float, pid: int) -> Stream:
    """Listen to a topic of Odometry for a while."""
    arrivals: list[tuple[float, float]] = []

    def hear(message: Any) -> None:
        stamp = message.header.stamp
        arrivals.append((time.monotonic(), stamp.sec + stamp.nanosec / 1e9))

    subscription = graph.node.create_subscription(Odometry, topic, hear, 100)
    wait(lambda: arrivals, topic)
    begin_s, cpu_before_s = time.monotonic(), cpu_s([pid])
    arrivals.clear()
    time.sleep(WATCH_S)
    cpu = (cpu_s([pid]) - cpu_before_s) / (time.monotonic() - begin_s)
    graph.destroy(subscription)
    arrived_s, stamped_s = ([times[i] for times in arrivals] for i in (0, 1))
    rate = (len(arrivals) - 1) / (arrived_s[-1] - arrived_s[0])
    period_s = 1 / rate_hz
    return Stream(rate, _jitter_s(arrived_s, period_s), _jitter_s(stamped_s, period_s), cpu)


def _jitter_s(times_s: list[float], period_s: float) -> float:
    return quantile([abs(b - a - period_s) for a, b in pairwise(times_s)], 0.99)


def bare_node(graph: Graph, file: Path, rate_hz: float) -> RobotNode:
    """The peer."""
    return RobotNode(graph, BARE_NODE.format(file=file, rate_hz=rate_hz))
