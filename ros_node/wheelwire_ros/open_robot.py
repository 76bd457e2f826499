"""The part of a node that exists while its robot is open."""

from __future__ import annotations

import time
from contextlib import ExitStack, suppress
from typing import Any

from wheelwire import (
    BaseDriver,
    HeldBy,
    InvalidCommand,
    Pose,
    SupervisorState,
    WheelSample,
    WheelwireError,
)
from wheelwire.link.sample_stream import Pacer
from wheelwire.log.why.diagnosis import Stop
from wheelwire.log.why.watch import StopWatch

from . import diagnostics, parameters, pose_memory, robot_state, sensors
from .commands import CommandSubscriber
from .motion_estimator import MotionEstimator
from .pose_memory import PoseMemory, PoseNotes
from .publishers import MotionPublisher, Topics, frame
from .reader import SampleReader
from .robot_connection import RobotConnection
from .robot_state import ResetWatch, RobotState, View
from .sensors import SensorPublisher
from .time_base import Offset, TimeBase

DRIVING = SupervisorState.DRIVING
OFFSET = "ros_offset_ns"
"""The note of a recording about the node's clock: the newest `Offset`s."""
STOPPING_S = 0.3
"""How long a robot goes on after its last command has expired."""
ODOM_STREAM = "odom"
"""The stamps of odom around a time without samples."""
LONGEST_TTL_S = 5.0
"""The upper bound of ttl_max_s."""


class OpenRobot:
    """An open robot with its topics and the thread that reads its samples.

    Args:
        node: A `HardwareRobot`, with all parameters declared.
        robot: Its driver; closed by `close`, and also if this raises.
        estopped: Latch the e-stop before anything else.

    Raises:
        WheelwireError: The robot refuses a parameter, or sends no sample.
    """

    def __init__(self, node: Any, robot: BaseDriver, *, estopped: bool) -> None:
        self._node = node
        self._newest: WheelSample | None = None
        self._closing = False
        self._is_held = False
        """Whether odom goes on without samples."""
        self._estopped_by_us = False
        self._stop = ""
        self._watch: StopWatch | None = None
        self._resets = ResetWatch()
        self._logged_warnings: dict[str, int] = {}
        """The session in which each was logged last."""
        self._preparing = False
        """Whether the worker prepares a session, or will."""
        clock = node.get_clock()
        self._time_base = TimeBase(
            lambda: int(clock.now().nanoseconds),
            node.get_logger(),
            is_simulated=lambda: bool(clock.ros_time_is_active),
            note_offsets=lambda offsets: robot.note(OFFSET, offsets),
        )
        replay: Any = robot if hasattr(robot, "noted") else None
        """The driver, if it replays a recording."""
        if replay is not None:
            self._time_base.recorded_offsets = lambda: [
                Offset(*one) for one in replay.noted(OFFSET) or ()
            ]
        self._notes = PoseNotes(robot, replay)
        # An error below closes in reverse order what is open so far; `pop_all` leaves it open.
        with ExitStack() as resources:
            resources.callback(robot.shutdown)
            self._prepare_robot(robot, estopped=estopped)
            self._join_graph(robot, resources)
            self._resources = resources.pop_all()

    def activate(self) -> None:
        """Obey commands, and publish."""
        self.connection.active = True
        self._reader.begin()

    def close(self) -> None:
        """Stop the wheels, then release everything, in reverse order."""
        # From here on, errors that threads report come from closing, and are not failures.
        self._closing = True
        self.connection.deactivate()
        self.connection.robot.shutdown()  # it stops first
        self._resources.close()

    def prepare_soon(self) -> None:
        """Have the session prepared if it is a new one, without waiting for it."""
        if self._preparing or self.connection.is_prepared:
            return
        # Not locked: if two threads get here at once, the second preparation has nothing to do.
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
        return robot_state.of_robot(self._view())

    def _view(self) -> View:
        connection = self.connection
        is_estopped = self._newest is not None and self._newest.state is SupervisorState.ESTOPPED
        # An e-stop of ours that was just cleared is still ours, until a sample shows its end.
        self._estopped_by_us = is_estopped and (self._estopped_by_us or connection.estopped)
        return View(
            connection,
            self._newest,
            self._reader.silence,
            self._resets,
            self._estopped_by_us,
            self._stop,
            self._sensors.limits(),
            self._is_held,
        )

    def statuses(self, name: str) -> list[Any]:
        """The statuses for /diagnostics."""
        if self._watch is not None and self._watch.error is not None:
            self._stop = str(self._watch.error)
        self._node.update_state()  # how far it rolled after a stop comes behind the stop
        self._time_base.measure()
        self._log_warnings()
        statuses = diagnostics.open_statuses(
            name,
            self._node.setting("driver_type"),
            self._view(),
            {
                "ros_clock_offset_error_s": self._time_base.error_s,
                "odometry_rebases": self.estimator.rebases,
                "samples_published": self._publisher.published,
                "samples_dropped": self._reader.dropped,
            },
            self._commands.ignored_types,
            self._sensors.channels,
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
        topics = Topics(self._node, self._node.threads, resources)
        get = sensors.with_battery_of_board(self._node.setting, robot)
        started = sensors.start(robot, get("imu_rate"))
        self._sensors = SensorPublisher(topics, started, get, self._time_base.to_ros_ns)
        # Waits for the first sample, which shows whether the board's divider measures the battery.
        first = robot.read()
        self._remember_pose(first, resources)
        has_divider = first.battery_v is not None
        has_battery = has_divider and not self._sensors.has_battery
        pose_memory.subscribe_set_pose(topics, self.set_pose, frame("odom_frame_id", get))
        self._publisher = MotionPublisher(topics, get, has_battery=has_battery)
        self._commands = CommandSubscriber(
            topics, self.connection, self.prepare_soon, self._time_base, get
        )
        if robot.has_device:
            robot.on_held = self._on_held
            resources.callback(setattr, robot, "on_held", None)
            with suppress(InvalidCommand):  # a recording, or a robot in virtual time
                self._watch = robot.watch_stops(self._on_stop)
                resources.callback(self._watch.close)
        # The last to begin and the first to end: its callbacks use all of the above.
        self._reader = SampleReader(
            robot,
            self._on_sample,
            self._on_reach,
            self._fail,
            self._on_silent,
            1 / get("publish_rate"),
        )
        resources.callback(self._reader.close)
        # The time of a recording that is replayed step by step passes as it is read.
        if getattr(robot, "speed", None) != 0:
            self._reader.begin()

    def _on_stop(self, stop: Stop) -> None:
        """Called in a thread of its own."""
        if not self._closing:
            self._stop = f"{stop.sentence} Look first at {stop.look_at}."
            self._update_state()

    def _on_held(self, _held_by: HeldBy) -> None:
        """Called in a thread of the driver's."""
        if not self._closing:
            self._update_state()

    def _update_state(self) -> None:
        """For threads of the driver's, which only log what is raised."""
        try:
            self._node.update_state()
        except Exception as error:
            self._fail(error)

    def _remember_pose(self, first: WheelSample, resources: ExitStack) -> None:
        node = self._node
        self._resets.note(first, self.connection.robot)
        setting = node.setting("pose_file")
        if setting == pose_memory.AUTO and node.setting("driver_type") in ("mock", "replay"):
            setting = ""  # each mock is a new robot, at its own place; a replay is not a robot
        name, board_id = node.get_fully_qualified_name(), self._resets.board_id
        path = pose_memory.path_of(setting, name, board_id)
        memory = PoseMemory(
            path, lambda: self._resets.board_id, self.estimator, node.poses, node.get_logger()
        )
        memory.open(first, self.connection.robot.ttl_max_s or LONGEST_TTL_S)
        resources.callback(memory.close)
        self._notes.begin(first, self.estimator)
        self._notes.note(self.estimator.record(first=first))

    def set_pose(self, where: Pose, covariance: Any) -> None:
        """Set the odometry to this pose."""
        self._notes.note(self.estimator.set_pose(where, covariance))

    def reset_odometry(self) -> None:
        """Move the origin of the odometry to the robot."""
        self._notes.note(self.estimator.reset())

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

    def _on_silent(self) -> None:
        """Called in the reader's thread, at the rate of odom, while no sample comes.

        A filter that hears nothing goes on at the last velocity.
        """
        newest = self._newest
        # A pause in a recording does not mean a lost robot.
        if newest is None or self._notes.replay is not None:
            return
        if not self._is_held:
            self._is_held = True
            self._node.update_state()
        if not (self.connection.active and self._node.context.ok()):
            return
        now_s = time.monotonic()
        motion = self.estimator.held(
            now_s - newest.stamp, is_driven=now_s < self.connection.driven_until_s + STOPPING_S
        )
        stamp_ns = self._time_base.to_ros_ns(now_s, ODOM_STREAM)
        if motion is not None:
            self._publisher.publish(motion, None, stamp_ns)

    def _on_sample(self, sample: WheelSample) -> None:
        """Called in the reader's thread."""
        before, self._newest = self._newest, sample
        was_held, self._is_held = self._is_held, False
        was_reset = self._resets.note(sample, self.connection.robot)
        # Each sample, also while the node is inactive: somebody may push the robot.
        motion = self.estimator.update(sample)
        record = self._notes.at(sample)
        if record is not None:
            self.estimator.restore(record)
        if was_reset:
            self._node.get_logger().warning(
                f"{self._resets.text}; odom may be off by {self.estimator.unseen_m:.2f} m, "
                "and by more if somebody moved the robot"
            )
        # A signal may end rclpy's context at any moment, after which nothing can be published.
        publishes = self.connection.active and self._node.context.ok()
        # Before the wheels' sample, which is the newest: a filter gets them in order.
        has_news = self._sensors.take(sample, publishes=publishes)
        if publishes and self._pacer.is_due(sample.t_us, sample.boot_id):
            stamp_ns = self._time_base.to_ros_ns(sample.stamp)
            if stamp_ns is not None:
                # One that came late may be older than what odom says of a silent robot.
                odom_ns = self._time_base.to_ros_ns(sample.stamp, ODOM_STREAM)
                self._publisher.publish(motion, stamp_ns, odom_ns)
        if before is not None and before.state is DRIVING and sample.state is not DRIVING:
            self.connection.note_standstill()
        if sample.state is DRIVING:
            self._stop = ""
        if (
            was_reset
            or was_held
            or has_news
            or before is None
            or (sample.state, sample.faults) != (before.state, before.faults)
        ):
            self._node.update_state()

    def _fail(self, error: Exception) -> None:
        """Stop the robot: without samples it must not go on driving."""
        if self._closing or not self._node.context.ok():
            return
        self.connection.robot.shutdown()
        self._node.threads.fail(error)
