"""Conversion of the link's clock, `time.monotonic()`, to the ROS clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

ATTEMPTS = 5
WAITING_FOR_CLOCK = (
    "waiting for /clock: use_sim_time is true and nothing publishes it; "
    "commands are obeyed, motion is published once it runs"
)


class TimeBase:
    """The offset between the two clocks, measured again from time to time.

    Samples are stamped with the monotonic clock. NTP may step the ROS clock, but never that one,
    so the offset does not stay the same. With `use_sim_time` the ROS clock reads 0 until the first
    message on /clock: until then no time can be converted.

    Args:
        ros_ns: Reads the ROS clock. [ns]
        log: The node's logger; it is told if the clock does not run yet, and when it begins to.
        monotonic_ns: Reads the clock of the samples' stamps. [ns]
    """

    def __init__(
        self,
        ros_ns: Callable[[], int],
        log: Any,
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._ros_ns = ros_ns
        self._log = log
        self._monotonic_ns = monotonic_ns
        self._offset_ns = 0
        self.error_s = 0.0
        """Error bound of the offset when it was measured. [s]"""
        self.runs = True
        """Whether the ROS clock has a time."""
        self.measure()

    def measure(self) -> None:
        """Measure the offset: of several readings the quickest, which was interrupted least."""
        self._note_whether_it_runs()
        if self.runs:
            width_ns, self._offset_ns = min(self._read() for _ in range(ATTEMPTS))
            self.error_s = width_ns / 2e9

    def to_ros_ns(self, stamp_s: float) -> int | None:
        """Convert a past monotonic time to ROS time; the result is never in the future.

        None if that was before the ROS clock's beginning.
        """
        if not self.runs:
            self.measure()
            if not self.runs:
                return None
        stamp_ns = round(stamp_s * 1e9)
        ros_ns = stamp_ns + self._offset_ns
        # A stamp in the future makes tf2 raise an extrapolation error. It shows that the ROS clock
        # was set back since the offset was measured.
        if ros_ns > self._ros_ns():
            self.measure()
            ros_ns = min(stamp_ns + self._offset_ns, self._ros_ns())
        # Simulations begin at 0: 0 is "no time" in a header, and a negative time is none at all.
        return ros_ns if ros_ns > 0 else None

    def _note_whether_it_runs(self) -> None:
        runs = self._ros_ns() > 0
        if runs != self.runs:
            self.runs = runs
            if runs:
                self._log.info("/clock runs: motion is published from now on")
            else:
                self._log.warning(WAITING_FOR_CLOCK)

    def _read(self) -> tuple[int, int]:
        # The ROS clock was read between the two readings of the other one: at their middle, within
        # half the time between them.
        before_ns = self._monotonic_ns()
        ros_ns = self._ros_ns()
        after_ns = self._monotonic_ns()
        return after_ns - before_ns, ros_ns - (before_ns + after_ns) // 2
