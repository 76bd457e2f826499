"""The thread that saves the robot's pose. Needs no rclpy."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from . import pose_file
from .pose_file import PoseFileError, PoseRecord

PERIOD_S = 1.0
JOIN_S = 2.0


class PoseSaver:
    """Saves the pose at most once a second, where it has changed, until `close`.

    In a thread of its own: a memory card may take longer for a file than a sample may wait.

    Args:
        path: The file.
        present: The present pose; None before the first sample.
        on_problem: Called with the reason when the file cannot be written, once in a row.
    """

    def __init__(
        self,
        path: Path,
        present: Callable[[], PoseRecord | None],
        on_problem: Callable[[str], None],
    ) -> None:
        self._path = path
        self._present = present
        self._on_problem = on_problem
        self._saved: PoseRecord | None = None
        self._has_failed = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wheelwire pose", daemon=True)
        self._thread.start()

    def close(self, last: PoseRecord | None) -> None:
        """End the thread, and save the last pose."""
        self._closing.set()
        self._thread.join(JOIN_S)
        if last is not None:
            self._save(last)

    def _run(self) -> None:
        while True:
            record = self._present()
            if record is not None and not self._is_saved(record):
                self._save(record)
            if self._closing.wait(PERIOD_S):
                return

    def _is_saved(self, record: PoseRecord) -> bool:
        # A robot that stands has nothing to write, though its clock goes on.
        return self._saved is not None and record == replace(self._saved, t_us=record.t_us)

    def _save(self, record: PoseRecord) -> None:
        try:
            pose_file.write(self._path, replace(record, saved_s=time.time()))
        except PoseFileError as error:
            if not self._has_failed:
                self._on_problem(str(error))
            self._has_failed = True
        else:
            self._saved, self._has_failed = record, False
