"""The part of a node that exists while its robot is open."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from wheelwire import BaseDriver, WheelSample, WheelwireError

from . import diagnostics, robot_settings
from .command_subscriber import LOG_PERIOD_S, CommandSubscriber
from .commands import CommandGate
from .connection import RobotConnection
from .estimator import MotionEstimator
from .pacing import Pacer
from .parameter_bridge import ParameterBridge
from .publishers import MotionPublisher
from .reader import SampleReader
from .services import RobotServices
from .time_base import TimeBase


class OpenRobot:
    """An open robot with its topics, its services and the thread that reads its samples.

    Args:
        node: The lifecycle node, with all parameters declared.
        robot: Its driver; closed by `close`, and also if this raises.
        bridge: The bridge of the node's parameters.
        on_failure: Called in the reader's thread when that fails; the wheels are stopped then.
        estopped: Latch the e-stop before anything else.

    Raises:
        WheelwireError: The robot refuses a parameter, or sends no sample.
    """

    def __init__(
        self,
        node: Any,
        robot: BaseDriver,
        bridge: ParameterBridge,
        on_failure: Callable[[Exception], None],
        *,
        estopped: bool,
    ) -> None:
        self._node = node
        self._bridge = bridge
        self._on_failure = on_failure
        self._newest: WheelSample | None = None
        self._closing = False
        self._time_base = TimeBase(
            lambda: int(node.get_clock().now().nanoseconds), node.get_logger()
        )
        # An error below closes in reverse order what has been opened; `pop_all` keeps it open.
        with ExitStack() as resources:
            resources.callback(robot.shutdown)
            self._prepare(robot, estopped=estopped)
            self._join_graph(robot, resources)
            self._resources = resources.pop_all()

    def close(self) -> None:
        """Stop the wheels, then release everything, in reverse order."""
        self._closing = True
        self.connection.active = False
        self.connection.robot.shutdown()  # it stops first
        self._resources.close()

    def follow(self) -> None:
        """Prepare the session if it is a new one."""
        try:
            self.connection.follow()
        except WheelwireError as error:
            self._node.get_logger().warning(str(error), throttle_duration_sec=LOG_PERIOD_S)

    def use_settings(self) -> None:
        """Apply the parameters that can change while the robot is open."""
        get, connection = self._node.setting, self.connection
        connection.gate.timeout_s = get("cmd_vel_timeout")
        connection.tuning = robot_settings.tuning(get)
        self._estimator.drive = connection.drive

    def statuses(self, name: str, driver_type: str) -> list[Any]:
        """The statuses for /diagnostics."""
        self._time_base.measure()
        report = diagnostics.Report(
            self.connection,
            self._newest,
            self._reader.silence,
            self._time_base.error_s,
            self._estimator.rebases,
            self._commands.ignored_types(),
            waiting_for_clock=not self._time_base.runs,
        )
        return diagnostics.open_statuses(name, driver_type, report)

    def _prepare(self, robot: BaseDriver, *, estopped: bool) -> None:
        get = self._node.setting
        self.connection = RobotConnection(
            robot,
            CommandGate(get("cmd_vel_timeout")),
            self._bridge.given,
            robot_settings.tuning(get),
            self._on_session,
        )
        self.connection.estopped = estopped
        self._estimator = MotionEstimator(self.connection.drive, get("wheel_variance"))
        self._pacer = Pacer(get("publish_rate"))
        self.connection.follow()

    def _join_graph(self, robot: BaseDriver, resources: ExitStack) -> None:
        node, connection = self._node, self.connection
        has_battery = robot.read().battery_v is not None
        self._publisher = MotionPublisher(
            node, robot_settings.topics(node.setting, has_battery=has_battery)
        )
        resources.callback(self._publisher.destroy)
        resources.callback(RobotServices(node, connection, self._estimator).destroy)
        stamped = node.setting("use_stamped_vel")
        self._commands = CommandSubscriber(node, connection, stamped=stamped)
        resources.callback(self._commands.destroy)
        changed = node.create_guard_condition(self._on_change)
        resources.callback(node.destroy_guard_condition, changed)
        self._reader = SampleReader(robot, self._on_sample, changed.trigger, self._fail)
        resources.callback(self._reader.close)

    def _on_session(self) -> None:
        """Read the parameters again: a robot that was reset or flashed may have others."""
        self._bridge.mirror(self.connection.robot)
        self.use_settings()

    def _on_change(self) -> None:
        """Report that the robot was lost or is back, perhaps in a new session."""
        silence = self._reader.silence
        if silence is None:
            self._node.get_logger().info("the robot is connected")
        else:
            self._node.get_logger().warning(f"the robot cannot be reached: {silence}")
        self._node.report()

    def _on_sample(self, sample: WheelSample) -> None:
        """Called in the reader's thread."""
        self._newest = sample
        motion = self._estimator.update(sample)
        if self.connection.active and self._node.context.ok() and self._pacer.is_due(sample):
            stamp_ns = self._time_base.to_ros_ns(sample.stamp)
            if stamp_ns is not None:
                self._publisher.publish(motion, stamp_ns)

    def _fail(self, error: Exception) -> None:
        """Called in the reader's thread. Without samples the robot must not go on driving."""
        if self._closing or not self._node.context.ok():
            return
        self.connection.robot.shutdown()
        self._on_failure(error)
