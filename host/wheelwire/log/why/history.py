"""The last seconds of a link: the evidence for the next stop."""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Callable, Sequence
from itertools import pairwise
from statistics import median
from typing import NamedTuple, TypeVar

from wheelwire_protocol.types import AnyMessage, Refuse

from ...link.requests import COPY_ID
from ...link.sample_stream import Measurement
from ...link.sensor_stream import InputsMeasurement, SensorMeasurement, SensorStream
from ...link.setpoints import ASKED
from ...link.traffic import STOP_ASKED, Kind, Record
from ...samples import INPUTS, tick_difference
from ..share.wire import decoded_json
from .causes import sensor_causes

T = TypeVar("T")
SPAN_US = 5_000_000
GAP_US = 100_000
"""A link's thread wakes up more often than this, if only for its pings. Without a stream it does so
only every 0.2 s: a gap alone does not show that it stood still."""
COPIES_US = 30_000
"""Time within which the link sends the copies of one stop."""
CLOCK_US = 2_000
"""A stop's time, by the device's clock, may be this much too early."""
NOTED_US = 200_000
"""On a busy computer, the note of who asked for a stop is this close to it."""
SUPPLY_PERIOD_US = 1_000_000
SUPPLY_POINTS = 1800


class Supply:
    """The battery's voltage over the last half hour, in memory that does not grow."""

    def __init__(self) -> None:
        self._numbers = array("d", bytes(8 * 3 * SUPPLY_POINTS))
        self._count = 0
        self._next_us = -math.inf

    def add(self, now_us: int, volts: float, *, driven: bool) -> None:
        """Add a point, at most one in SUPPLY_PERIOD_US."""
        if now_us < self._next_us:
            return
        at = self._count % SUPPLY_POINTS * 3
        self._numbers[at : at + 3] = array("d", (now_us, volts, driven))
        self._count += 1
        self._next_us = now_us + SUPPLY_PERIOD_US

    def points(self) -> list[tuple[float, float, float]]:
        """Time [us], voltage [V] and whether the wheels drove (0 or 1), oldest first."""
        oldest = self._count % SUPPLY_POINTS * 3 if self._count > SUPPLY_POINTS else 0
        found = self._numbers[oldest : self._count * 3] + self._numbers[:oldest]
        return list(zip(found[::3], found[1::3], found[2::3], strict=True))


class Asked(NamedTuple):
    """A setpoint that the application asked for."""

    host_us: int
    left: float
    right: float
    expiry_us: int


class History:
    """The last seconds of a link.

    Attributes:
        samples: Measured.
        asked: Setpoints of the application.
        sent: Messages that the port took, and when.
        refusals: Refusals of setpoints, and when.
        gaps: Times, from and to, when nothing at all happened in the program.
        supply: Battery voltage over the last half hour.
        stop_us: When the application last asked for a stop or an e-stop.
    """

    def __init__(self) -> None:
        self.samples: deque[Measurement] = deque()
        self.asked: deque[Asked] = deque()
        self.sent: deque[tuple[int, AnyMessage]] = deque()
        self.refusals: deque[tuple[int, Refuse]] = deque()
        self.gaps: deque[tuple[int, int]] = deque()
        self.supply = Supply()
        self.stop_us = -SPAN_US
        self._stop_asked = -SPAN_US, ""
        self._inputs: SensorMeasurement | None = None
        self._stopping: dict[str, str] = {}
        """The sensors that stop the robot now, and the cause."""
        self._stopped: dict[str, tuple[int, str]] = {}
        """The sensors that stopped the robot before, when that ended, and the cause."""
        self._explained: dict[str | int, dict[int, int]] = {}
        """The times of the stops that one kind of message explains, and until when such messages
        were sent that explain no later stop."""
        self._newest_us: int | None = None

    def note(self, record: Record) -> None:
        """A record of the link."""
        now_us = record.host_us
        if self._newest_us is not None and now_us - self._newest_us >= GAP_US:
            self.gaps.append((self._newest_us, now_us))
        self._newest_us = max(now_us, self._newest_us or now_us)
        if record.kind in (Kind.VELOCITY, Kind.DUTY):
            left, right, expiry_us = ASKED.unpack(record.data)
            self.asked.append(Asked(now_us, left, right, expiry_us))
        elif record.kind in (Kind.STOP, Kind.STOP_COPY):
            self.stop_us = now_us
        elif record.kind is Kind.NOTE:
            asked = decoded_json(record.data).get(STOP_ASKED)
            if isinstance(asked, dict):
                self._stop_asked = asked.get("host_us", 0), str(asked.get("by", ""))
        self._forget(now_us - SPAN_US)

    def note_sample(self, measurement: Measurement) -> None:
        """A sample."""
        self.samples.append(measurement)
        volts = battery_v(measurement)
        if volts is not None:
            self.supply.add(measurement.arrived_us, volts, driven=drives(measurement))

    def note_sensors(self, sensors: SensorStream, now_us: int) -> None:
        """Which sensors stop the robot now, as far as they were asked for."""
        inputs = sensors.newest.get(INPUTS)
        if inputs is self._inputs:
            return
        self._inputs = inputs
        found = sensor_causes(inputs) if isinstance(inputs, InputsMeasurement) else {}
        for name in self._stopping.keys() - found.keys():
            self._stopped[name] = now_us, self._stopping[name]
        self._stopping = found

    def begin_boot(self) -> None:
        """Forget what was before a reset of the device."""
        self.samples.clear()
        self.refusals.clear()
        self.sent.clear()

    def _forget(self, before_us: int) -> None:
        _drop(self.samples, lambda one: one.arrived_us < before_us)
        _drop(self.asked, lambda one: one.host_us < before_us)
        _drop(self.sent, lambda one: one[0] < before_us)
        _drop(self.refusals, lambda one: one[0] < before_us)
        _drop(self.gaps, lambda one: one[1] < before_us)

    # --- questions -------------------------------------------------------------------------------

    def stopping_sensors(self, at_us: int) -> dict[str, str]:
        """The sensors that have stopped the robot since then, by name, and the cause."""
        ended = {name: cause for name, (when, cause) in self._stopped.items() if when >= at_us}
        return self._stopping | ended

    def was_sent(self, kind: type[AnyMessage], since_us: int) -> bool:
        """Whether this host sent such a message since then."""
        return any(isinstance(message, kind) and at >= since_us for at, message in self.sent)

    def stops_by(self, kind: type[AnyMessage], at_us: int, span_us: int) -> list[int]:
        """When such messages were sent that may have stopped the robot then.

        A message that stopped it earlier does not count, nor do its repeats, so they do not explain
        a later stop.

        Args:
            kind: Kind of the messages.
            at_us: When it stopped.
            span_us: How long before it they may have been sent.
        """
        sent = [
            (at, getattr(message, "request_id", COPY_ID))
            for at, message in self.sent
            if isinstance(message, kind)
        ]
        before_us = self.explained_us(kind.__name__, at_us)
        until_us = self._explained.get(kind.__name__, {}).get(before_us, -SPAN_US)
        # What was not answered in time is repeated under its number; copies all have the same.
        used = {number for at, number in sent if at <= until_us}
        found = [
            (at, number)
            for at, number in sent
            if at >= at_us - span_us
            and (at > before_us + COPIES_US if number == COPY_ID else number not in used)
        ]
        if found:
            # A copy that stops the robot goes out before its number does: that may be after the
            # stop, and another stop may follow within a millisecond.
            nearest_us = min((at for at, _ in found), key=lambda at: abs(at - at_us))
            numbers = (at for at, number in found if number != COPY_ID and at >= nearest_us)
            # One that went out later than the clocks differ may be that other stop's own.
            is_early = nearest_us <= at_us + CLOCK_US
            until_us = next(numbers, nearest_us) if is_early else at_us
            self.note_explained(kind.__name__, at_us, until_us)
        return [at for at, _ in found]

    def note_explained(self, by: str | int, at_us: int, until_us: int = 0) -> None:
        """What stopped the robot at `at_us` explains no later stop.

        Args:
            by: Name or number of the message.
            at_us: When the robot stopped.
            until_us: When the last message of this kind was sent that belongs to this stop, if
                that was later.
        """
        known = self._explained.setdefault(by, {})
        known[at_us] = max(at_us, until_us)
        for old in [one for one in known if one < at_us - SPAN_US]:
            del known[old]

    def explained_us(self, by: str | int, at_us: int) -> int:
        """When the stop before this one was that was explained by the same."""
        known = self._explained.get(by, {})
        return max((one for one in known if one < at_us), default=-SPAN_US)

    def who_asked(self, kind: type[AnyMessage], sent: Sequence[int]) -> str:
        """The programs that asked this link for the stop or e-stop that it sent at these times."""
        asked_us, by = self._stop_asked
        every = [at for at, message in self.sent if isinstance(message, kind)]
        nearest = min(every, key=lambda at: abs(at - asked_us))
        if nearest not in sent:  # it asked for one before
            return "this program asked"
        # Another stop may have followed soon. One is sent twice: a copy goes out at once.
        if abs(nearest - asked_us) < NOTED_US and sent[-1] - nearest < COPIES_US:
            return f"{by}, asked beside this program"
        return "this program asked"

    def period_s(self) -> float | None:
        """The median time between setpoints of the last seconds; None with less than two."""
        times = [one.host_us for one in self.asked]
        return median(later - one for one, later in pairwise(times)) / 1e6 if times[1:] else None

    def gap_over_s(self, at_us: int, after_us: int) -> float:
        """The time in which nothing of the program ran, from before `at_us` until `after_us` later.

        What the device sends at that moment ends the gap of a link that only waits.
        """
        found = (end - begin for begin, end in self.gaps if begin <= at_us <= end - after_us)
        return max(found, default=0) / 1e6

    def longest_gap_s(self, since_us: int) -> float:
        """The longest time since then in which nothing of the program ran, in seconds."""
        return max((end - max(begin, since_us) for begin, end in self.gaps), default=0) / 1e6

    def host_us(self, t_us: int) -> int | None:
        """A time of the device's, 32 bits, on the host's clock; None without a sample."""
        if not self.samples:
            return None
        newest = self.samples[-1]
        # The device's clock wraps as its counters do.
        return round(newest.sample().stamp * 1e6) + tick_difference(t_us, newest.state.t_us)


def _drop(found: deque[T], is_old: Callable[[T], bool]) -> None:
    while found and is_old(found[0]):
        found.popleft()


def battery_v(measurement: Measurement) -> float | None:
    """The supply's voltage in V, where the device measures it."""
    millivolts = measurement.state.battery_mv
    return millivolts / 1000 if millivolts else None


def drives(measurement: Measurement) -> bool:
    """Whether a motor is driven."""
    return bool(measurement.state.left_duty_q15 or measurement.state.right_duty_q15)
