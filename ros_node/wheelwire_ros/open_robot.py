"""The part of a node that exists while its robot is open."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from typing import Any

from wheelwire import BaseDriver, SupervisorState, WheelSample, WheelwireError

from . import diagnostics, parameters, pose, robot_state
from .commands import CommandSubscriber
from .connection import RobotConnection
from .estimator import MotionEstimator
from .publishers import MotionPublisher
from .reader import Pacer, SampleReader
from .robot_state import ResetWatch, RobotState
from .time_base import TimeBase

DRIVING = SupervisorState.DRIVING
LONGEST_TTL_S = 5.0
"""The upper bound of ttl_max_s."""


class OpenRobot:
    """An open robot with its topics and the thread that reads its samples.

    Args:
        node: A `BaseRobotNode`, with all parameters declared.
        robot: Its driver; closed by `close`, and also if this raises.
        estopped: Latch the e-stop before anything else.

    Raises:
        WheelwireError: The robot refuses a parameter, or sends no sample.
    """

    def __init__(self, node: Any, robot: BaseDriver, *, estopped: bool) -> None:
        self._node = node
        self._newest: WheelSample | None = None
        self._closing = False
        self._estopped_by_us = False
        self._resets = ResetWatch()
        self._logged_warnings: dict[str, int] = {}
        """The session in which each was logged last."""
        self._preparing = False
        """Whether the worker prepares a session, or will."""
        self._time_base = TimeBase(
            lambda: int(node.get_clock().now().nanoseconds),
            node.get_logger(),
            is_simulated=lambda: bool(node.get_clock().ros_time_is_active),
        )
        # An error below closes in reverse order what is open so far; `pop_all` leaves it open.
        with ExitStack() as resources:
            resources.callback(robot.shutdown)
            self._prepare_robot(robot, estopped=estopped)
            self._join_graph(robot, resources)
            self._resources = resources.pop_all()

    def close(self) -> None:
        """Stop the wheels, then release everything, in reverse order."""
        # From here on the threads report errors of the closing, which are no failures.
        self._closing = True
        self.connection.deactivate()
        self.connection.robot.shutdown()  # it stops first
        self._resources.close()

    def prepare_soon(self) -> None:
        """Have the session prepared if it is a new one, without waiting for it."""
        if self._preparing or self.connection.is_prepared:
            return
        # Not locked: if two threads come here at once, the second preparation has nothing to do.
        self._preparing = True
        with suppress(RuntimeError):  # the worker is shut down, and so is the robot soon
            self._node.threads.requests.submit(self._prepare)

    def use_settings(self) -> None:
        """Apply the parameters that can change while the robot is open."""
        self.connection.tuning = parameters.tuning(self._node.setting)
        self.estimator.drive = self.connection.drive

    def clear_fault(self) -> None:
        """Clear the latched faults, and acknowledge resets of the device.

        Raises:
            WheelwireError: Their cause is present, or the robot cannot be reached.
        """
        self.connection.clear_fault()
        self._resets.acknowledge()
        self._node.update_state()

    def state(self) -> RobotState:
        """For `~/state`."""
        connection = self.connection
        is_estopped = self._newest is not None and self._newest.state is SupervisorState.ESTOPPED
        # An e-stop of ours that was just cleared is still ours, until a sample shows its end.
        self._estopped_by_us = is_estopped and (self._estopped_by_us or connection.estopped)
        return robot_state.of_robot(
            self._newest,
            self._reader.silence,
            connection.problem,
            connection.robot.sessions,
            self._resets,
            prepared=connection.is_prepared,
            estopped=self._estopped_by_us,
        )

    def statuses(self, name: str, driver_type: str) -> list[Any]:
        """The statuses for /diagnostics."""
        self._time_base.measure()
        self._log_warnings()
        statuses = diagnostics.open_statuses(
            name,
            driver_type,
            self.connection,
            self._newest,
            self._reader.silence,
            self.state(),
            {
                "ros_clock_offset_error_s": self._time_base.error_s,
                "odometry_rebases": self.estimator.rebases,
                "samples_published": self._publisher.published,
                "samples_dropped": self._reader.dropped,
            },
            self._commands.ignored_types,
        )
        return statuses if self._time_base.runs else [*statuses, diagnostics.clock_status(name)]

    def _log_warnings(self) -> None:
        """Log each warning once per session; diagnostics have them as long as they last."""
        robot = self.connection.robot
        for text in diagnostics.warnings_of(robot):
            if self._logged_warnings.get(text) != robot.sessions:
                self._logged_warnings[text] = robot.sessions
                self._node.get_logger().warning(text)

    def _prepare_robot(self, robot: BaseDriver, *, estopped: bool) -> None:
        get = self._node.setting
        self.connection = RobotConnection(
            robot, self._node.bridge.given, parameters.tuning(get), self._on_session
        )
        # All of this before `follow`, which sends the e-stop first, and then calls `_on_session`.
        self.connection.estopped = estopped
        self.estimator = MotionEstimator(
            self.connection.drive, get("wheel_variance"), get("velocity_rolling_window_size")
        )
        self._pacer = Pacer(get("publish_rate"))
        self.connection.follow()

    def _join_graph(self, robot: BaseDriver, resources: ExitStack) -> None:
        node, threads, get = self._node, self._node.threads, self._node.setting
        # Waits for the first sample, which shows whether there is a topic for the battery.
        first = robot.read()
        self._remember_pose(first, resources)
        topics = parameters.topics(get, has_battery=first.battery_v is not None)
        pose.subscribe_set_pose(node, threads, resources, self.estimator, topics.frames.odom)
        self._publisher = MotionPublisher(node, threads, resources, topics)
        self._commands = CommandSubscriber(
            node,
            self.connection,
            threads,
            resources,
            self.prepare_soon,
            self._time_base,
            parameters.command_type(get),
            topics.frames.base if get("publish_limited_velocity") else "",
        )
        # The last to begin and the first to end: its callbacks use all of the above.
        self._reader = SampleReader(robot, self._on_sample, self._on_reach, self._fail)
        resources.callback(self._reader.close)

    def _remember_pose(self, first: WheelSample, resources: ExitStack) -> None:
        node = self._node
        self._resets.note(first, self.connection.robot)
        setting = node.setting("pose_file")
        if setting == pose.AUTO and node.driver_type == "mock":
            setting = ""  # each one is another robot, at a place of its own
        name, board_id = node.get_fully_qualified_name(), self._resets.board_id
        path = pose.path_of(setting, name, board_id)
        longest_s = self.connection.robot.ttl_max_s or LONGEST_TTL_S
        self._node.poses.open(path, lambda: self._resets.board_id, first, self.estimator, longest_s)
        resources.callback(self._node.poses.close)

    def _prepare(self) -> None:
        """Runs in the request worker."""
        try:
            with suppress(WheelwireError):  # `connection.problem` has it
                self.connection.follow()
        except Exception as error:
            self._fail(error)
        finally:
            self._preparing = False
        if not self._closing:
            self._node.update_state()

    def _on_session(self) -> None:
        """Read the parameters again: a robot that was reset or flashed may have others."""
        self._node.bridge.mirror(self.connection.robot)
        self.use_settings()

    def _on_reach(self) -> None:
        """Called in the reader's thread: the robot is lost, or back, perhaps in a new session."""
        self.prepare_soon()
        self._node.update_state()

    def _on_sample(self, sample: WheelSample) -> None:
        """Called in the reader's thread."""
        before, self._newest = self._newest, sample
        was_reset = self._resets.note(sample, self.connection.robot)
        # Each sample, also while the node is inactive: somebody may push the robot.
        motion = self.estimator.update(sample)
        if was_reset:
            self._node.get_logger().warning(
                f"{self._resets.text}; odom may be off by {self.estimator.unseen_m:.2f} m, "
                "and by more if somebody moved the robot"
            )
        # A signal may end rclpy's context at any moment, after which nothing can be published.
        if self.connection.active and self._node.context.ok() and self._pacer.is_due(sample):
            stamp_ns = self._time_base.to_ros_ns(sample.stamp)
            if stamp_ns is not None:
                self._publisher.publish(motion, stamp_ns)
        if before is not None and before.state is DRIVING and sample.state is not DRIVING:
            self.connection.note_standstill()
        if (
            was_reset
            or before is None
            or (sample.state, sample.faults) != (before.state, before.faults)
        ):
            self._node.update_state()

    def _fail(self, error: Exception) -> None:
        """Without samples the robot must not go on driving."""
        if self._closing or not self._node.context.ok():
            return
        self.connection.robot.shutdown()
        self._node.threads.fail(error)
