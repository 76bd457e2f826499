"""Conversion of the link's clock, `time.monotonic()`, to the ROS clock."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

ATTEMPTS = 5
SAME_NS = 20_000
"""Two measured offsets that differ by less are the same one."""
SET_BACK_NS = 100_000_000
"""An offset that is smaller by more than this is one of a clock that was set back: what remains is
the error of a measurement on a busy computer."""
AHEAD_NS = 100_000_000
"""How long after its measurement an offset applies: no sample is stamped that much earlier."""
KEPT = 16
"""Offsets: a sample may be stamped some time after the newest is known."""
RATE_WINDOW_NS = 4_000_000_000
RATE_STEP_NS = 100_000_000
SLOWEST = 0.01
"""The least rate assumed of /clock: if it stood still, no command would ever expire."""
WAITING_FOR_CLOCK = (
    "waiting for /clock: use_sim_time is true and nothing publishes it; "
    "commands are obeyed, motion is published once it runs"
)


class Offset(NamedTuple):
    """ROS time less monotonic time, of the stamps from one on until the next offset."""

    from_ns: int
    offset_ns: int


def _offset_at(offsets: Sequence[Offset], stamp_ns: int) -> int:
    known = [one for one in offsets if one.from_ns <= stamp_ns]
    return (known[-1] if known else offsets[0]).offset_ns


@dataclass
class TimeBase:
    """The offset between the two clocks, measured again from time to time.

    Samples are stamped with the monotonic clock. NTP may step the ROS clock, but never the
    monotonic clock, so the offset changes. With `use_sim_time` the ROS clock reads 0 until the
    first message on /clock: until then no time can be converted. Then it advances by steps, as
    messages come, and at any speed: the speed is measured, too.

    Args:
        ros_ns: Reads the ROS clock. [ns]
        is_simulated: Whether the ROS clock is /clock.
        log: The node's logger, for a clock that does not run yet, and for when it begins to.
        monotonic_ns: Reads the clock of the samples' stamps. [ns]
        note_offsets: Called with the newest offsets, before a sample can be stamped with the last
            one.
        recorded_offsets: For samples of a recording: its own offsets, which are then used;
            otherwise empty.
    """

    ros_ns: Callable[[], int]
    log: Any
    monotonic_ns: Callable[[], int] = time.monotonic_ns
    is_simulated: Callable[[], bool] = lambda: False
    note_offsets: Callable[[Sequence[Offset]], object] = lambda _: None
    recorded_offsets: Callable[[], Sequence[Offset]] = lambda: ()

    def __post_init__(self) -> None:
        self._seen: deque[tuple[int, int]] = deque()
        """Readings of the monotonic clock and of /clock, the newest last, over `RATE_WINDOW_NS`."""
        self._lock = threading.Lock()
        self._last: dict[str, tuple[int, int]] = {}
        """The last conversion of each stream: what /clock said, and the result."""
        self._offsets: tuple[Offset, ...] = ()
        """The newest last."""
        self._converted: dict[str, Offset] = {}
        """The last time of each stream, with the offset that made it."""
        self.error_s = 0.0
        """Error bound of the offset when it was measured. [s]"""
        self.runs = True
        """Whether the ROS clock has a time."""
        self.rate = 1.0
        """How fast the ROS clock runs: seconds of it in a second."""
        self.measure()

    def measure(self, from_ns: int | None = None) -> None:
        """Measure the offset: of several readings the quickest, which was interrupted least.

        Args:
            from_ns: Stamps from this one on get it; by default, from a moment later on.
        """
        self._note_whether_it_runs()
        if self.runs and self.is_simulated():
            self._follow_simulation()
        elif self.runs:
            self.rate = 1.0
            width_ns, offset_ns = min(self._read() for _ in range(ATTEMPTS))
            self.error_s = width_ns / 2e9
            # Where both agree, none is better; the stamps of a constant one do not jitter.
            if not self._offsets:
                self._use(Offset(0, offset_ns))
            elif abs(offset_ns - self._offsets[-1].offset_ns) > width_ns / 2 + SAME_NS:
                # None of the samples that get it has been stamped yet. So only their own stamps
                # decide which get it, and a recording is stamped in the same way again.
                soon_ns = self.monotonic_ns() + AHEAD_NS
                self._use(Offset(soon_ns if from_ns is None else from_ns, offset_ns))

    def _use(self, offset: Offset) -> None:
        self._offsets = (*self._offsets, offset)[-KEPT:]
        self.note_offsets(self._offsets)

    def to_ros_ns(self, stamp_s: float, stream: str = "wheels") -> int | None:
        """Convert a past monotonic time to ROS time; the result is never in the future.

        Within a stream, time never runs backward: None if it would, unless somebody set the ROS
        clock back. Also None if the time is before the beginning of the ROS clock, or if /clock has
        not advanced since the stream's last conversion: only the first of its samples between two
        steps gets a time.
        """
        if not self.runs:
            self.measure()
            if not self.runs:
                return None
        stamp_ns = round(stamp_s * 1e9)
        recorded = self.recorded_offsets()
        if recorded:
            offset_ns = _offset_at(recorded, stamp_ns)
            return self._later(stream, stamp_ns + offset_ns, offset_ns)
        if self.is_simulated():
            return self._to_simulated_ns(stamp_ns, stream)
        offset_ns = _offset_at(self._offsets, stamp_ns)
        ros_ns = stamp_ns + offset_ns
        # A stamp in the future makes tf2 raise an extrapolation error. It shows that the ROS clock
        # was set back since the offset was measured.
        if ros_ns > self.ros_ns():
            self.measure(from_ns=stamp_ns)
            offset_ns = _offset_at(self._offsets, stamp_ns)
            ros_ns = min(stamp_ns + offset_ns, self.ros_ns())
        # Simulations begin at 0. In a header, 0 means "no time", and a negative time is invalid.
        return self._later(stream, ros_ns, offset_ns) if ros_ns > 0 else None

    def _later(self, stream: str, ros_ns: int, offset_ns: int) -> int | None:
        """The time, if it is later than the stream's last one, or the ROS clock was set back."""
        last = self._converted.get(stream)
        is_set_back = last is not None and offset_ns < last.offset_ns - SET_BACK_NS
        if last is not None and ros_ns <= last.from_ns and not is_set_back:
            return None
        self._converted[stream] = Offset(ros_ns, offset_ns)
        return ros_ns

    def _to_simulated_ns(self, stamp_ns: int, stream: str) -> int | None:
        now_ns, ros_now_ns = self._follow_simulation()
        step_ns, last_ros_ns = self._last.get(stream, (0, 0))
        if ros_now_ns == step_ns:
            return None
        is_later = ros_now_ns > step_ns
        ros_ns = min(ros_now_ns - round((now_ns - stamp_ns) * self.rate), ros_now_ns)
        # Where the speed of /clock changes, the ages of two samples are of different speeds.
        if is_later and ros_ns <= last_ros_ns:
            ros_ns = ros_now_ns
        self._last[stream] = ros_now_ns, ros_ns
        return ros_ns if ros_ns > 0 else None

    def _follow_simulation(self) -> tuple[int, int]:
        """Read both clocks, and measure how fast the ROS clock runs."""
        with self._lock:
            now_ns, ros_ns = self.monotonic_ns(), self.ros_ns()
            if self._seen and ros_ns < self._seen[-1][1]:  # a recording that restarts
                self._seen.clear()
            if not self._seen or now_ns - self._seen[-1][0] >= RATE_STEP_NS:
                self._seen.append((now_ns, ros_ns))
                while now_ns - self._seen[0][0] > RATE_WINDOW_NS:
                    self._seen.popleft()
            then_ns, ros_then_ns = self._seen[0]
            if now_ns - then_ns >= RATE_WINDOW_NS / 4:
                self.rate = max((ros_ns - ros_then_ns) / (now_ns - then_ns), SLOWEST)
            self.error_s = 0.0
            return now_ns, ros_ns

    def _note_whether_it_runs(self) -> None:
        runs = self.ros_ns() > 0
        if runs != self.runs:
            self.runs = runs
            if runs:
                self.log.info("/clock runs: motion is published from now on")
            else:
                self.log.warning(WAITING_FOR_CLOCK)

    def _read(self) -> tuple[int, int]:
        # The ROS clock was read between the two readings of the other one: at their middle, within
        # half the time between them.
        before_ns = self.monotonic_ns()
        ros_ns = self.ros_ns()
        after_ns = self.monotonic_ns()
        return after_ns - before_ns, ros_ns - (before_ns + after_ns) // 2
