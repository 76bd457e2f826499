"""Where the odometry goes on when a robot is opened again."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from wheelwire import DifferentialDrive, Pose, WheelSample

from . import pose_file
from .estimator import MotionEstimator
from .pose_file import PoseFileError, PoseRecord
from .pose_saver import PERIOD_S, PoseSaver
from .set_pose import words

MOVED_M, MOVED_RAD = 0.1, 0.2
"""What is allowed for a robot that stood while nothing counted: somebody may have pushed it."""


class PoseMemory:
    """Remembers the pose of each board from one opening of the robot to the next.

    In this process, and in a file for the next process.

    Args:
        logger: The node's.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._closed: dict[str, PoseRecord] = {}
        self._path: Path | None = None
        self._saver: PoseSaver | None = None
        self._board_id = ""
        self._present: Callable[[bool], PoseRecord | None] = lambda _is_final: None

    def open(
        self,
        path: Path | None,
        board_id: Callable[[], str],
        first: WheelSample,
        estimator: MotionEstimator,
        longest_drive_s: float,
    ) -> None:
        """Let the odometry go on from where it was, and save it from now on.

        Args:
            path: The file; None for none.
            board_id: The board that counts: where another one is connected later, its ticks are
                none of this one's.
            first: Its first sample.
            estimator: Before its first update.
            longest_drive_s: How long a robot drives on at most that nobody commands any more.
        """
        self._path, self._board_id = path, board_id()
        self._present = lambda is_final: (
            estimator.record(self._board_id, is_final=is_final)
            if board_id() == self._board_id
            else None
        )
        record = self._find()
        if record is not None:
            self._resume(record, first, estimator, longest_drive_s)
        if path is not None:
            self._saver = PoseSaver(path, lambda: self._present(False), self._warn)

    def close(self) -> None:
        """Save the last pose; the wheels are stopped."""
        record = self._present(True)
        if record is not None:
            self._closed[self._board_id] = record
        saver, self._saver = self._saver, None
        if saver is not None:
            saver.close(record)

    def _find(self) -> PoseRecord | None:
        if self._path is not None:
            try:
                found = pose_file.read(self._path)
            except PoseFileError as error:
                self._warn(str(error))
            else:
                if found is not None and found.board_id == self._board_id:
                    return found
                if found is not None:
                    self._warn(f"{self._path}: it is of another board")
        return self._closed.get(self._board_id)

    def _resume(
        self,
        record: PoseRecord,
        first: WheelSample,
        estimator: MotionEstimator,
        longest_drive_s: float,
    ) -> None:
        place = words(Pose(*record.pose))
        if record.boot_id == first.boot_id:
            update = estimator.resume(record, first)
            turn = math.degrees(update.turn_rad)
            self._logger.info(
                f"the odometry goes on from {place}: meanwhile the wheels counted "
                f"{update.distance_m:.3f} m and a turn of {turn:.1f} degrees"
            )
            return
        off_m, off_rad = how_far_off(record, estimator.drive, longest_drive_s)
        estimator.resume_after_reset(record, off_m, off_rad)
        self._logger.warning(
            f"the odometry goes on from {place}, but the device was reset since and counted "
            f"nothing: it may be off by {off_m:.2f} m and {math.degrees(off_rad):.0f} degrees, and "
            "by more if somebody moved the robot; ~/set_pose or ~/reset_odometry sets it right"
        )

    def _warn(self, problem: str) -> None:
        self._logger.warning(f"pose_file: {problem}; without it a restart loses the pose")


def how_far_off(
    record: PoseRecord, drive: DifferentialDrive, longest_drive_s: float
) -> tuple[float, float]:
    """How far a robot may be from where it was, in m and rad, if nobody moved it.

    Args:
        record: Where it was.
        drive: Its geometry and its speed.
        longest_drive_s: How long its last command may have acted.
    """
    if record.is_final:
        return MOVED_M, MOVED_RAD
    # The node died: its last command may have been given just before, and is in no file.
    unseen_s = min(record.age_s, PERIOD_S + longest_drive_s)
    off_m = drive.max_velocity_mps * unseen_s
    turn_rad = 2 * off_m / drive.wheel_separation
    return max(off_m, MOVED_M), min(max(turn_rad, MOVED_RAD), math.pi)
