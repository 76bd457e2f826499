"""The link's clock and ROS's: `time.monotonic()` seconds to nanoseconds of the ROS clock."""

from __future__ import annotations

import time
from collections.abc import Callable

ATTEMPTS = 5


class TimeBase:
    """One offset between two clocks, measured anew from time to time.

    NTP slews and steps the ROS clock, never the monotonic one, in which the device's samples are.

    Args:
        ros_ns: The ROS clock. [ns]
        monotonic_ns: The clock of the samples' stamps. [ns]
    """

    def __init__(
        self,
        ros_ns: Callable[[], int],
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._ros_ns = ros_ns
        self._monotonic_ns = monotonic_ns
        self._offset_ns = 0
        self.error_s = 0.0
        """Bound of the offset's error when it was measured. [s]"""
        self.measure()

    def measure(self) -> None:
        """Read both clocks; the reading that was interrupted least is the best."""
        width_ns, self._offset_ns = min(self._read() for _ in range(ATTEMPTS))
        self.error_s = width_ns / 2e9

    def to_ros_ns(self, stamp_s: float) -> int:
        """The ROS time of a monotonic one that has passed; never in the future."""
        stamp_ns = round(stamp_s * 1e9)
        ros_ns = stamp_ns + self._offset_ns
        if ros_ns > self._ros_ns():  # the ROS clock was set back
            self.measure()
            ros_ns = min(stamp_ns + self._offset_ns, self._ros_ns())
        return ros_ns

    def _read(self) -> tuple[int, int]:
        before_ns = self._monotonic_ns()
        ros_ns = self._ros_ns()
        after_ns = self._monotonic_ns()
        return after_ns - before_ns, ros_ns - (before_ns + after_ns) // 2
