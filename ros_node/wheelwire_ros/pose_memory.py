"""The robot's pose across restarts, in `pose_file`, and `~/set_pose`.

`PoseMemory` resumes the odometry when a robot is opened, from the file or from the last record of
this process, and writes the file. `subscribe_set_pose` serves the topic.
"""

from __future__ import annotations

import json
import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped

from wheelwire import BaseDriver, DifferentialDrive, Pose, WheelSample
from wheelwire.whole_file import write_whole

from .motion_estimator import MotionEstimator, PoseRecord
from .publishers import PLANAR, Topics
from .threads import JOIN_S

AUTO = "auto"
"""The value that means a file in ROS's own folder, named after node and board."""
FORMAT = 1
PERIOD_S = 1.0
MOVED_M, MOVED_RAD = 0.1, 0.2
"""Allowed for a robot that stood while nothing counted: somebody may have pushed it."""
POSE = "pose"
"""The note about where the node began, or was set to: the newest `PoseRecord`s."""
POSES = 8
"""A replay sets fewer poses while it takes one sample."""
TOPIC = "~/set_pose"
LOOSE = 1e-3
"""The rounding error allowed in a quaternion that somebody typed."""


class PoseFileError(Exception):
    """The file cannot be used; says why."""


def path_of(setting: str, node_name: str, board_id: str) -> Path | None:
    """The file that `pose_file` means; None for none.

    Args:
        setting: The parameter: `auto`, a path, or nothing.
        node_name: With its namespace.
        board_id: So that two robots of one name, on two domains, do not share a file.
    """
    if setting != AUTO:
        return Path(setting).expanduser() if setting else None
    home = os.environ.get("ROS_HOME") or "~/.ros"
    name = "-".join(filter(None, [node_name.strip("/").replace("/", "."), board_id]))
    return Path(home).expanduser() / "wheelwire" / f"{name}.pose.json"


def read(path: Path) -> PoseRecord | None:
    """The file's record; None if there is no file.

    Raises:
        PoseFileError: The file cannot be read, or is not a pose file.
    """
    try:
        return _record(json.loads(path.read_text("utf-8")))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise PoseFileError(f"{path}: {error}") from error
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise PoseFileError(f"{path}: it is not a pose file of this release ({error})") from error


def write(path: Path, record: PoseRecord) -> None:
    """Replace the file: a reader finds the old one or the new one, also after a power cut.

    Raises:
        PoseFileError: It cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps({"format": FORMAT, **asdict(record)}).encode())
    except OSError as error:
        raise PoseFileError(f"{path}: {error}") from error


def _record(found: Any) -> PoseRecord:
    if found.pop("format") != FORMAT:
        raise ValueError("another format")
    lists = {name: tuple(found[name]) for name in ("pose", "covariance")}
    one = PoseRecord(**{**found, **lists})
    numbers = (*one.pose, *one.covariance, one.saved_s)
    counters = (one.boot_id, one.t_us, one.left_ticks, one.right_ticks, one.left_total)
    # By `type`, because to Python a bool is an int.
    if not (
        (len(one.pose), len(one.covariance)) == (3, 9)
        and all(type(number) in (int, float) and math.isfinite(number) for number in numbers)
        and all(type(counter) is int for counter in (*counters, one.right_total))
        and min(one.covariance[::4]) >= 0
        and (type(one.board_id), type(one.is_final)) == (str, bool)
    ):
        raise ValueError("a value of the wrong type, or out of range")
    return one


class PoseNotes:
    """A recording's notes of where the node began, or was set to, each with its sample.

    Args:
        robot: The driver, which may record.
        replay: It, if it replays a recording.
    """

    def __init__(self, robot: BaseDriver, replay: Any) -> None:
        self._robot = robot
        self.replay = replay
        self._poses: deque[dict[str, Any]] = deque(maxlen=POSES)

    def note(self, record: PoseRecord | None) -> None:
        """Add one, if it is known."""
        if record is not None:
            self._poses.append(asdict(record))
            self._robot.note(POSE, list(self._poses))

    def begin(self, first: WheelSample, estimator: MotionEstimator) -> None:
        """Begin where that node did, if it stood: its first sample may be another one."""
        known = [one for one in self._records() if one.boot_id == first.boot_id]
        before = [one for one in known if one.t_us <= first.t_us]
        for record in before[-1:] or known[:1]:
            estimator.resume(record, first)

    def at(self, sample: WheelSample) -> PoseRecord | None:
        """The one that was set at this sample, if there is one."""
        for record in reversed(self._records()):
            if (record.boot_id, record.t_us) == (sample.boot_id, sample.t_us):
                return record
        return None

    def _records(self) -> list[PoseRecord]:
        if self.replay is None:
            return []
        return [_record({"format": FORMAT, **one}) for one in self.replay.noted(POSE) or ()]


@dataclass
class PoseMemory:
    """Remembers the pose of a board from one opening of the robot to the next.

    In this process, and in a file for the next process. A thread writes the file at most once a
    second, and only after a change: a memory card may take longer than a sample may wait.

    Args:
        path: The file; None for none.
        board_id: Returns the identity of the present board. After another board was connected,
            nothing is saved: that board's ticks do not continue this one's.
        estimator: Before its first update.
        closed: The last record of each board in this process.
        logger: The node's.
    """

    path: Path | None
    board_id: Callable[[], str]
    estimator: MotionEstimator
    closed: dict[str, PoseRecord]
    logger: Any

    def __post_init__(self) -> None:
        self._own = self.board_id()
        self._saved: PoseRecord | None = None
        self._has_failed = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wheelwire pose", daemon=True)

    def open(self, first: WheelSample, longest_drive_s: float) -> None:
        """Resume the odometry from the last pose, and save it from now on.

        Args:
            first: The robot's first sample.
            longest_drive_s: How long a robot drives on at most after its node has died.
        """
        record = self._find()
        if record is not None:
            self._resume(record, first, longest_drive_s)
        if self.path is not None:
            self._thread.start()

    def close(self) -> None:
        """Save the last pose; the wheels have stopped."""
        record = self._present()
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(JOIN_S)
        if record is not None:
            final = self.closed[self._own] = replace(record, is_final=True)
            self._save(final)

    def _present(self) -> PoseRecord | None:
        return self.estimator.record(self._own) if self.board_id() == self._own else None

    def _run(self) -> None:
        while True:
            record, saved = self._present(), self._saved
            # A standing robot has nothing to write, although its clock advances.
            if record is not None and (saved is None or replace(saved, t_us=record.t_us) != record):
                self._save(record)
            if self._closing.wait(PERIOD_S):
                return

    def _save(self, record: PoseRecord) -> None:
        try:
            if self.path is not None:
                write(self.path, replace(record, saved_s=time.time()))
        except PoseFileError as error:
            if not self._has_failed:
                self._warn(str(error))
            self._has_failed = True
        else:
            self._saved, self._has_failed = record, False

    def _find(self) -> PoseRecord | None:
        found = None
        try:
            found = read(self.path) if self.path is not None else None
        except PoseFileError as error:
            self._warn(str(error))
        if found is not None and found.board_id != self._own:
            self._warn(f"{self.path}: it is another board's")
            found = None
        return found or self.closed.get(self._own)

    def _resume(self, record: PoseRecord, first: WheelSample, longest_drive_s: float) -> None:
        place = words(Pose(*record.pose))
        if record.boot_id == first.boot_id:
            update = self.estimator.resume(record, first)
            turn = math.degrees(update.turn_rad)
            self.logger.info(
                f"the odometry goes on from {place}: meanwhile the wheels counted "
                f"{update.distance_m:.3f} m and a turn of {turn:.1f} degrees"
            )
            return
        off_m, off_rad = how_far_off(record, self.estimator.drive, longest_drive_s)
        self.estimator.resume_after_reset(record, off_m, off_rad)
        self.logger.warning(
            f"the odometry goes on from {place}, but the device was reset since and counted "
            f"nothing: the pose may be off by {off_m:.2f} m and {math.degrees(off_rad):.0f} "
            "degrees, and by more if somebody moved the robot; correct it with ~/set_pose or "
            "~/reset_odometry"
        )

    def _warn(self, problem: str) -> None:
        self.logger.warning(f"pose_file: {problem}; without it a restart loses the pose")


def how_far_off(
    record: PoseRecord, drive: DifferentialDrive, longest_drive_s: float
) -> tuple[float, float]:
    """How far a robot may be from its last known pose, in m and rad, unless somebody moved it.

    Args:
        record: The last known pose.
        drive: The robot's geometry and speed.
        longest_drive_s: How long its last command may have acted.
    """
    if record.is_final:
        return MOVED_M, MOVED_RAD
    # The node died: a last command just before that is in no file. The age is never negative,
    # though somebody may have set back the wall clock.
    age_s = max(0.0, time.time() - record.saved_s)
    off_m = drive.max_velocity_mps * min(age_s, PERIOD_S + longest_drive_s)
    turn_rad = 2 * off_m / drive.wheel_separation
    return max(off_m, MOVED_M), min(max(turn_rad, MOVED_RAD), math.pi)


def subscribe_set_pose(
    topics: Topics, set_pose: Callable[[Pose, Any], object], odom_frame: str
) -> None:
    """Set the pose of the odometry to that of each message on `~/set_pose`, with its covariance.

    Args:
        topics: The node's.
        set_pose: Sets the pose of the odometry.
        odom_frame: The odometry's frame; the node refuses a pose in another one.
    """
    node = topics.node
    logger = node.get_logger()

    def on_pose(message: PoseWithCovarianceStamped) -> None:
        frame = message.header.frame_id
        if frame not in {"", odom_frame}:
            logger.warning(f"{TOPIC} ignored: the pose is in {frame}; give it in {odom_frame}")
            return
        try:
            pose = planar_pose(message.pose.pose)
            covariance = planar_covariance(message.pose.covariance)
        except ValueError as error:
            logger.warning(f"{TOPIC} ignored: {error}")
            return
        set_pose(pose, covariance)
        logger.info(f"the pose was set to {words(pose)}")

    create = partial(node.create_subscription, PoseWithCovarianceStamped, TOPIC, on_pose, 1)
    topics.entity(create, node.destroy_subscription)


def planar_pose(pose: Any) -> Pose:
    """The place and the heading of a geometry_msgs/Pose.

    Raises:
        ValueError: A robot on a floor cannot have this pose.
    """
    x, y, z, w = (getattr(pose.orientation, axis) for axis in "xyzw")
    numbers = (pose.position.x, pose.position.y, x, y, z, w)
    if not all(map(math.isfinite, numbers)):
        raise ValueError("a number is not finite")
    if abs(x * x + y * y + z * z + w * w - 1) > LOOSE:
        raise ValueError(
            "the orientation is not a unit quaternion; for heading 0 give x, y, z = 0 and w = 1"
        )
    if max(abs(x), abs(y)) > LOOSE:
        raise ValueError("the pose rolls or pitches; give one on a level floor")
    return Pose(pose.position.x, pose.position.y, 2 * math.atan2(z, w))


def planar_covariance(covariance: Sequence[float]) -> Any:
    """Covariance of (x, y, heading), 3 by 3, from ROS's 6 by 6.

    Raises:
        ValueError: It is not a covariance.
    """
    matrix = np.asarray(covariance, dtype=np.float64).reshape(6, 6)[np.ix_(PLANAR, PLANAR)]
    if not np.all(np.isfinite(matrix)):
        raise ValueError("a covariance is not finite")
    if not np.allclose(matrix, matrix.T) or np.linalg.eigvalsh(matrix)[0] < -LOOSE:
        raise ValueError("the covariance of x, y and yaw is not symmetrical, or below 0")
    return matrix


def words(pose: Pose) -> str:
    """A pose for a person."""
    return f"x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, {math.degrees(pose.heading_rad):.1f} degrees"
