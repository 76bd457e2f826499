"""A simulated robot, its node, and a client that commands it: what most tests of the node need."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile

from support import stop_host
from support.ros import Diagnostics, Graph, Repeater, open_graph, wait
from support.ros_process import RobotNode
from support.simulator_on_line import GOOD, simulator_on
from wheelwire.simulation.simulator import Simulator, TrueState
from wheelwire_protocol.codes import SupervisorState
from wheelwire_ros.motion_estimator import HELD_MPS

NODE = "/hardware_robot"
SPEED_MPS = 0.3
TRUTH_HZ = 200.0
SILENT_S = 1.0
SECOND = 1_000_000_000
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def twist(linear_mps: float, angular_radps: float = 0.0) -> Any:
    return Twist(linear=Vector3(x=linear_mps), angular=Vector3(z=angular_radps))


def stamp_s(message: Any) -> float:
    """The time in a message's header."""
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec / 1e9)


def stamped_after(messages: deque[Any], begin_s: float) -> list[Any]:
    """What was published after a moment; what arrives after it may have been on its way."""
    return [message for message in tuple(messages) if stamp_s(message) > begin_s]


def is_measured(odometry: Any) -> bool:
    """Whether a sample is behind it: of a silent robot, the node holds the pose, at velocity 0."""
    return bool(odometry.twist.covariance[0] < HELD_MPS**2)


def stands(messages: deque[Any]) -> bool:
    """Whether the newest odometry says, by a sample, that the robot stands."""
    newest = messages[-1]
    velocity = newest.twist.twist
    return is_measured(newest) and bool(velocity.linear.x == velocity.angular.z == 0)


def wait_past(graph: Graph, messages: deque[Any], seconds: float) -> float:
    """Wait until a topic is `seconds` past now; returns now.

    By its stamps: how many messages have arrived says nothing, for many may be on their way.
    """
    begin_s = graph.now_s()
    wait(lambda: messages and stamp_s(messages[-1]) > begin_s + seconds, f"{seconds} s of a topic")
    return begin_s


@contextmanager
def silent(graph: Graph, messages: deque[Any], *, beside: deque[Any]) -> Iterator[None]:
    """Check that a topic is silent for a second of another; the block makes it go on again.

    The topics of a node that publishes in order arrive out of step.
    """
    begin_s = wait_past(graph, beside, SILENT_S)
    end_s = begin_s + SILENT_S
    yield
    wait(lambda: stamped_after(messages, end_s), "messages after the silence")
    assert stamp_s(stamped_after(messages, begin_s)[0]) > end_s


class State:
    """What ~/state reported last."""

    def __init__(self, graph: Graph) -> None:
        self.told: list[Any] = []
        graph.node.create_subscription(DiagnosticStatus, f"{NODE}/state", self.told.append, LATCHED)

    def wait(self, condition: Callable[[dict[str, str]], bool]) -> Any:
        """Until the newest message fulfils a condition of its values."""
        wait(lambda: self.told and condition(values(self.told[-1])), "a condition of ~/state")
        return self.told[-1]


def values(status: Any) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


class Rig:
    """One robot on its own graph.

    Attributes:
        odometry: The messages on odom, the newest last.
        commands: The publisher of cmd_vel.
    """

    def __init__(
        self, graph: Graph, simulator: Simulator, node: RobotNode, *, stamped: bool
    ) -> None:
        self.graph = graph
        self.simulator = simulator
        self.node = node
        self.odometry: deque[Any] = graph.listen(Odometry, "odom")
        self.diagnostics = Diagnostics(graph)
        self.commands = graph.publisher(TwistStamped if stamped else Twist, "cmd_vel")
        self._is_stamped = stamped
        wait(lambda: self.odometry, "odom")

    def stamped(self, linear_mps: float, age_s: float = 0.0) -> Any:
        """A command given `age_s` ago."""
        message = TwistStamped(twist=twist(linear_mps))
        stamp_ns = self.graph.node.get_clock().now().nanoseconds - round(age_s * 1e9)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, SECOND)
        return message

    def warnings(self, text: str) -> int:
        """How many warnings with this text the node has logged."""
        return sum("[WARN]" in line and text in line for line in self.node.errors().splitlines())

    def truth(self, condition: Callable[[TrueState], bool]) -> TrueState:
        """The plant's first state from now on that fulfils a condition."""
        self.simulator.take_states()
        return stop_host.wait(self.simulator, condition)

    def command(self, linear_mps: float, angular_radps: float = 0.0) -> Any:
        """A command of now, of the rig's type."""
        if not self._is_stamped:
            return twist(linear_mps, angular_radps)
        message = self.stamped(linear_mps)
        message.twist.angular.z = angular_radps
        return message

    def drive_on(self) -> TrueState:
        """Command once, and wait until the robot drives."""
        self.simulator.take_states()
        self.commands.publish(self.command(SPEED_MPS))
        return stop_host.wait(self.simulator, lambda state: state.drive_on)

    def driving(self, linear_mps: float = SPEED_MPS, angular_radps: float = 0.0) -> Repeater:
        """Drive repeatedly during a `with` block."""
        return Repeater(self.commands, lambda: self.command(linear_mps, angular_radps))

    def arm(self) -> None:
        """After a clear: command standstill until the robot obeys. Before that nothing drives."""
        with self.driving(0.0):
            self.truth(lambda state: state.state is SupervisorState.DRIVING)

    def wait_past(self, seconds: float) -> float:
        """Wait until odom is `seconds` past now; returns now."""
        return wait_past(self.graph, self.odometry, seconds)

    def x_m(self) -> float:
        """The robot's x in odom."""
        return float(self.odometry[-1].pose.pose.position.x)

    def ignored(self, reason: str) -> int:
        """The number of commands ignored for a reason; waits for the first one."""
        key = f"ignored_{reason}"
        return int(self.diagnostics.wait("commands", lambda _, values: key in values)[key])


@contextmanager
def open_rig(
    directory: Path,
    *,
    code: str | None = None,
    stamped: bool = False,
    line: str = GOOD,
    **parameters: Any,
) -> Iterator[Rig]:
    """A rig whose node is active; `code` as for `RobotNode`, `line` as of `simulator_on`."""
    with (
        open_graph() as graph,
        simulator_on(line, link=directory / "port", truth_hz=TRUTH_HZ) as simulator,
        RobotNode(graph, code, port=simulator.port, use_stamped_vel=stamped, **parameters) as node,
    ):
        yield Rig(graph, simulator, node, stamped=stamped)
