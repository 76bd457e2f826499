"""The device's clock relative to the host's: offset, drift, and a guaranteed bound. Sans-IO.

Four timestamps an exchange, as in NTP (RFC 5905): t1 host sends, t2 device receives, t3 device
sends, t4 host receives. The true offset lies within half the round trip of the estimate, however
asymmetric the two delays are. For clocks that drift apart evenly, a least-squares line through such
offsets at time h is a weighted sum of them with weights w_i(h), so its error is at most
sum |w_i| r_i / 2, and by Cauchy-Schwarz at most sqrt(sum w_i^2) sqrt(sum r_i^2) / 2.

Also the device's time in 64 bits, and when the device was last heard, which decides when to ping.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple

from wheelwire_protocol.types import Ping, Pong

from .requests import ID_MODULUS

WINDOW = 64
"""Exchanges remembered: half a minute at two a second."""
# Consecutive exchanges; a fit uses the one with the shortest round trip.
GROUP = 4
FIT_FROM = 4 * GROUP
"""A line through fewer exchanges says nothing about the drift."""
SPACING_US = 400_000
"""Once a line is fitted, exchanges in quicker succession are only checked against it, not added:
the window has to span half a minute, and a fit costs more than anything else an idle link does."""
MAX_DRIFT = 500e-6
"""The most that any two clocks drift apart: two crystals do, and NTP slews the host's by up to
500 ppm."""
MAX_SLOPE = 0.1
"""A steeper fit is not drift: the device's clock stood still, or the answers are wrong."""
DRIFT_CHANGE = 2e-6
"""How far the drift can depart from the fit since the last exchange, due to temperature."""
RESOLUTION_US = 1.0
"""Timestamps are whole microseconds."""
CLOCK_MODULUS = 1 << 32
_HALF_TURN = CLOCK_MODULUS // 2
"""Half the range of the device's times in samples, in microseconds."""
AHEAD_US = 1_000_000
"""A message may seem to come from so much later than the bound of the estimate allows: a clock was
stepped. If it counted as one of an hour ago, all that follow would be dropped."""


def host_clock_us() -> int:
    """`time.monotonic()` in whole microseconds: the host's clock of the whole library."""
    return time.monotonic_ns() // 1000


# A partial, not a function of Python: it is called at each read.
BOOT_CLOCK_NS: Callable[[], int] | None = (
    partial(time.clock_gettime_ns, time.CLOCK_BOOTTIME) if hasattr(time, "CLOCK_BOOTTIME") else None
)
"""A clock that runs on while the computer sleeps; None if there is none."""


class SuspendWatch:
    """Detects that the computer was suspended: its monotonic clock stops during suspension."""

    STEP_US = 10_000
    """The two clocks compared run at the same rate, so a step means a suspension."""

    def __init__(self, boot_clock_ns: Callable[[], int] | None = None) -> None:
        self.boot_clock_ns = boot_clock_ns or BOOT_CLOCK_NS or time.monotonic_ns
        self._longest_us = 0
        """The longest that the computer can have been suspended up to the last check."""
        self.limit_us = 0
        """How far the boot clock may be ahead of the host's for `was_suspended` to be False: who
        asks often need not call it."""
        # The first check only sets what later ones are compared with.
        self.was_suspended(host_clock_us())

    def was_suspended(self, now_us: int) -> bool:
        """Whether it was suspended since the last check. `now_us` was read just before."""
        boot_us = self.boot_clock_ns() // 1000
        # The thread may be preempted between two readings; that must not look like a suspension, so
        # their difference is bounded from both sides: `now_us` was read before, this is after.
        shortest_us = boot_us - host_clock_us()
        former_us, self._longest_us = self._longest_us, boot_us - now_us
        self.limit_us = shortest_us + self.STEP_US
        return shortest_us > former_us + self.STEP_US


class Exchange(NamedTuple):
    """One ping and its answer, in microseconds."""

    host_sent_us: int
    device_received_us: int
    device_sent_us: int
    host_received_us: int

    @property
    def round_trip_us(self) -> int:
        """Time in transit, both directions, without the device's processing time."""
        # The device may seem to have taken longer than all of it: `SLACK_US` says by how much.
        on_host = self.host_received_us - self.host_sent_us
        return max(0, on_host - (self.device_sent_us - self.device_received_us))


class _Reading(NamedTuple):
    """What an exchange says, computed once because every later fit uses it again."""

    host_us: int
    """The host's clock in the middle of the exchange."""
    offset_us: int
    """The device's clock in the middle of the exchange, less the host's."""
    round_trip_us: int

    @classmethod
    def of(cls, exchange: Exchange) -> _Reading:
        host_us = (exchange.host_sent_us + exchange.host_received_us) // 2
        device_us = (exchange.device_sent_us + exchange.device_received_us) // 2
        return cls(host_us, device_us - host_us, exchange.round_trip_us)


class _Line(NamedTuple):
    """offset(h) = base + a + b (h - origin), the device's clock less the host's."""

    origin_us: int
    base_us: int
    a_us: float
    b: float
    mean_us: float
    """Where the line is known best, relative to `origin_us`."""
    error_us: float
    error_slope: float
    """error(h)^2 = error_us^2 + (error_slope (h - mean))^2 for a fit."""
    last_us: int
    growth: float
    """Error per microsecond after `last_us`."""

    def offset_us(self, host_us: float) -> float:
        return self.a_us + self.b * (host_us - self.origin_us)

    def contradicts(self, reading: _Reading) -> bool:
        # Both bounds hold for certain, so the two can differ by no more than their sum.
        error = abs(reading.offset_us - self.base_us - self.offset_us(reading.host_us))
        return error > self.bound_us(reading.host_us) + reading.round_trip_us / 2

    def bound_us(self, host_us: float) -> float:
        slope = self.error_slope * (host_us - self.origin_us - self.mean_us)
        # In both directions: a sample may be older than the last exchange, an expiry is later.
        growth = self.growth * abs(host_us - self.last_us)
        return math.hypot(self.error_us, slope) + growth + RESOLUTION_US


class Conversion:
    """An estimate that no longer changes. Of its lines, at each time the surest one counts."""

    __slots__ = ("lines",)

    def __init__(self, lines: Sequence[_Line]) -> None:
        self.lines = lines

    def host_to_device(self, host_us: int) -> tuple[int, float]:
        """The device's clock at the host's `host_us`, and the bound of its error, both in us."""
        if not self.lines:
            self.check()  # raises
        best, best_error_us = self.lines[0], math.inf
        for line in self.lines:  # a plain loop takes half as long, and every setpoint needs this
            # `line.bound_us`, without the call.
            slope = line.error_slope * (host_us - line.origin_us - line.mean_us)
            growth = line.growth * abs(host_us - line.last_us)
            error_us = math.hypot(line.error_us, slope) + growth + RESOLUTION_US
            if error_us < best_error_us:
                best, best_error_us = line, error_us
        # `best.offset_us`, without the call.
        offset_us = best.a_us + best.b * (host_us - best.origin_us)
        return host_us + best.base_us + round(offset_us), best_error_us

    def device_to_host(self, device_us: int) -> tuple[int, float]:
        """The host's clock at the device's `device_us`, and the bound of its error, both in us."""
        if not self.lines:
            self.check()  # raises
        best_us, best_error_us = 0, math.inf
        for line in self.lines:  # a plain loop takes half as long, and every sample needs this
            # The formula of `_Line`, with offset(h) written as device time less h, solved for h.
            elapsed = device_us - line.base_us - line.origin_us - line.a_us
            host_us = line.origin_us + round(elapsed / (1 + line.b))
            # `line.bound_us`, without the call.
            slope = line.error_slope * (host_us - line.origin_us - line.mean_us)
            growth = line.growth * abs(host_us - line.last_us)
            error_us = math.hypot(line.error_us, slope) + growth + RESOLUTION_US
            if error_us < best_error_us:
                best_us, best_error_us = host_us, error_us
        return best_us, best_error_us

    def check(self) -> None:
        """Raise `RuntimeError` if there is no estimate yet."""
        if not self.lines:
            raise RuntimeError("the clock is not synchronised")


class ClockEstimator:
    """Keeps the exchanges of one session and converts times between the two clocks.

    One thread adds; any may convert.

    Args:
        readings: Another estimator's readings, to continue from.

    Attributes:
        conversion: The estimate at this moment; replaced as a whole.
    """

    def __init__(self, readings: Iterable[Sequence[int]] = ()) -> None:
        self._readings = deque((_Reading(*reading) for reading in readings), maxlen=WINDOW)
        self.conversion = Conversion(())
        if self._readings:
            self._estimate()

    @property
    def synchronised(self) -> bool:
        """True once there was an exchange; the conversions need one."""
        return bool(self.conversion.lines)

    @property
    def readings(self) -> Sequence[tuple[int, int, int]]:
        """What remains of the exchanges, for another estimator."""
        return list(self._readings)

    def add(self, exchange: Exchange) -> None:
        """Take one exchange into the estimate."""
        reading = _Reading.of(exchange)
        # Looked for in every exchange, even in one that is too soon to be stored.
        if any(line.contradicts(reading) for line in self.conversion.lines):
            self._readings.clear()  # a clock was stepped: earlier readings are void
        # Before there is a line every exchange counts, however soon after the last one.
        elif (
            len(self._readings) >= FIT_FROM
            and reading.host_us < self._readings[-1].host_us + SPACING_US
        ):
            return
        self._readings.append(reading)
        self._estimate()

    def _estimate(self) -> None:
        # The constant offset is surest just after a quick exchange, the fit between them.
        lines = [_constant_offset(self._readings)]
        if len(self._readings) >= FIT_FROM:
            fit = _fit(list(self._readings))
            if abs(fit.b) < MAX_SLOPE:
                lines.append(fit)
        self.conversion = Conversion(lines)  # other threads may convert at any time

    def unwrap(self, t_us: int, host_us: int) -> int:
        """The 64-bit device time, in us, of a 32-bit `t_us` that came at the host's `host_us`.

        The latest that is possible: a message may have waited for long, but it comes from the past.
        """
        device_us, error_us = self.conversion.host_to_device(host_us)
        latest_us = device_us + math.ceil(error_us) + AHEAD_US
        return latest_us - (latest_us - t_us) % CLOCK_MODULUS


def _constant_offset(readings: Sequence[_Reading]) -> _Line:
    """A constant offset: through the reading that gives the tightest bound now.

    Nothing is assumed about drift but its limit: the bound grows by MAX_DRIFT with age.
    """
    # Twice the bounds, round_trip / 2 + MAX_DRIFT (now - host), without the term in `now`.
    bounds = [r.round_trip_us - 2 * MAX_DRIFT * r.host_us for r in readings]
    best = readings[bounds.index(min(bounds))]
    return _Line(
        origin_us=best.host_us,
        base_us=best.offset_us,
        a_us=0.0,
        b=0.0,
        mean_us=0.0,
        error_us=best.round_trip_us / 2,
        error_slope=0.0,
        last_us=best.host_us,
        growth=MAX_DRIFT,
    )


def _fit(readings: Sequence[_Reading]) -> _Line:
    """Least squares through the shortest round trip of each group of consecutive readings.

    The shortest round trips alone would cluster in time, which would leave the slope unknown.
    """
    groups = [readings[start : start + GROUP] for start in range(0, len(readings), GROUP)]
    chosen = [min(group, key=attrgetter("round_trip_us")) for group in groups]
    n = len(chosen)
    # Relative to the first reading: the squares of absolute microseconds exceed a float's 53 bits.
    origin, base = chosen[0].host_us, chosen[0].offset_us
    times = [r.host_us - origin for r in chosen]
    offsets = [r.offset_us - base for r in chosen]
    mean_time, mean_offset = sum(times) / n, sum(offsets) / n
    spread = sum((t - mean_time) ** 2 for t in times) or 1.0  # all at once: the slope is then 0
    products = zip(times, offsets, strict=True)
    b = sum((t - mean_time) * (o - mean_offset) for t, o in products) / spread
    # In the bound of the module's docstring, sum w_i^2 is 1/n at the mean time and grows with
    # (h - mean)^2 / spread.
    length = math.sqrt(sum(r.round_trip_us**2 for r in chosen))
    return _Line(
        origin_us=origin,
        base_us=base,
        a_us=mean_offset - b * mean_time,
        b=b,
        mean_us=mean_time,
        error_us=length / 2 / math.sqrt(n),
        error_slope=length / 2 / math.sqrt(spread),
        last_us=readings[-1].host_us,
        growth=DRIFT_CHANGE,
    )


BURST = 8
"""Pings at the start of a session, each sent when the one before is answered or lost."""
BURST_TIMEOUT_US = 25_000
"""Also between pings until the first answer; a later answer is still accepted."""
PERIOD_US = 500_000
OPEN_PINGS = 80
"""Unanswered pings remembered, two seconds of them; older ones count as lost."""
# Beyond any uptime. An expiry computed from a larger time might not fit into its 64 bits.
MAX_DEVICE_US = 1 << 62
SLACK_US = 1000
"""A device may seem to have held a ping this much longer than the whole exchange took."""


class Synchroniser:
    """Keeps the clock of one session.

    Args:
        session_id: The session's.
        send: Takes a message for the line.
        due_us: When the next ping is due, on the host's clock.

    Attributes:
        sent_us: When the last one was sent.
    """

    def __init__(self, session_id: int, send: Callable[[Ping], None], due_us: int) -> None:
        self.session_id = session_id
        self.send = send
        self.due_us = due_us
        self.sent_us = 0
        self.clock = ClockEstimator()
        self._burst_left = BURST
        self._last_id = 0
        """Pings have their own numbers: the device would take an id far ahead of the last request's
        for an old one."""
        self._open: dict[int, int] = {}

    def snapshot(self) -> dict[str, Any]:
        """What `resumed` takes."""
        return {
            "due_us": self.due_us,
            "sent_us": self.sent_us,
            "last_id": self._last_id,
            "open": list(self._open.items()),
            "readings": self.clock.readings,
        }

    @classmethod
    def resumed(
        cls, session_id: int, send: Callable[[Ping], None], known: dict[str, Any]
    ) -> Synchroniser:
        """A synchroniser that goes on where another one was, behind its first burst."""
        this = cls(session_id, send, known["due_us"])
        this.sent_us = known["sent_us"]
        this.clock = ClockEstimator(known["readings"])
        this._burst_left = 0
        this._last_id = known["last_id"]
        this._open = dict(known["open"])
        return this

    @property
    def ready(self) -> bool:
        """The first burst is sent and the clock is known."""
        return self._burst_left <= 0 and self.clock.synchronised

    def awaits_pong(self, now_us: int) -> bool:
        """Whether an answer is still likely to come."""
        return bool(self._open) and now_us < self.sent_us + BURST_TIMEOUT_US

    def ping(self, now_us: int) -> None:
        """Send a ping. A lost one is never repeated: its time would be wrong."""
        self._last_id = request_id = (self._last_id + 1) % ID_MODULUS
        self._open[request_id] = now_us
        if len(self._open) > OPEN_PINGS:  # a dict keeps its order: the oldest
            del self._open[next(iter(self._open))]
        self._burst_left -= 1
        self.sent_us = now_us
        self.due_us = now_us + (PERIOD_US if self.ready else BURST_TIMEOUT_US)
        self.send(Ping(self.session_id, request_id, now_us))

    def on_pong(self, pong: Pong, now_us: int) -> Exchange | None:
        """Take an answer that came at `now_us`; None if no ping is open or it is impossible."""
        # t1 is taken from the pong, so it has to be the time that was sent under this id.
        if self._open.get(pong.request_id) != pong.host_us:
            return None
        # The CRC lets one bad frame in four billion pass, and another host's pong may come: a wrong
        # exchange would be mistaken for a step of the clock.
        held_us = pong.sent_us - pong.received_us
        if not 0 <= held_us <= now_us - pong.host_us + SLACK_US or pong.sent_us > MAX_DEVICE_US:
            return None
        # Only once, even if the line doubles the frame.
        del self._open[pong.request_id]
        exchange = Exchange(pong.host_us, pong.received_us, pong.sent_us, now_us)
        self.clock.add(exchange)
        # Within the burst the next ping goes out at once: opening a session waits for its end.
        self.due_us = now_us + PERIOD_US if self._burst_left <= 0 else now_us
        return exchange


# --- the device's time in 64 bits, of messages that carry its lower 32 ----------------------------

UNWRAP_US = 60_000_000
"""Messages closer to each other than this need no estimate of the clock: 32 bits wrap in 71 min."""


class DeviceTime:
    """Unwraps the times of a stream of messages, mostly from the newest one before.

    The age of that one counts, not its arrival: while a program was stopped, messages may have
    waited for it for an hour, and a fresh one follows them at once.

    Attributes:
        t_us: The newest message's time, 64 bits. [us]
        host_us: The host's clock at that time, as far as it is known. [us]
    """

    __slots__ = ("_clock", "host_us", "t_us")

    def __init__(self) -> None:
        self.t_us = self.host_us = 0
        self._clock: ClockEstimator | None = None

    def follow(self, t_us: int, clock: ClockEstimator, now_us: int, *, newer: bool = False) -> bool:
        """Take the newest message's time `t_us`, 32 bits; it came at the host's `now_us`.

        Args:
            t_us: Its lower 32 bits.
            clock: The session's.
            now_us: The host's clock.
            newer: Leave out a message that is not newer than the newest, and return False.
        """
        # Another clock is another session's: the computer may have slept before it, and its own
        # clock with it.
        if clock is self._clock and now_us < self.host_us + UNWRAP_US:
            # As `tick_difference`, without a call: each state frame comes through here.
            step_us = (t_us - self.t_us + _HALF_TURN) % CLOCK_MODULUS - _HALF_TURN
            if newer and step_us <= 0:
                return False
            host_us = self.host_us + step_us
            self.t_us += step_us
        else:
            found_us = clock.unwrap(t_us, now_us)
            if newer and found_us <= self.t_us:
                return False
            host_us = round(clock.conversion.device_to_host(found_us)[0])
            self.t_us, self._clock = found_us, clock
        self.host_us = host_us if host_us < now_us else now_us
        return True

    def snapshot(self) -> tuple[int, int]:
        """What `resume` takes."""
        return self.t_us, self.host_us

    def resume(self, t_us: int, host_us: int) -> None:
        """Go on behind the message of a snapshot."""
        self.t_us, self.host_us = t_us, host_us


# --- when the device was last heard ---------------------------------------------------------------

SILENCE_US = 2_000_000
"""No pong and no state frame for this long: the session is over, say hello again."""
QUIET_US = 100_000
"""Nothing was received for this long: ping, because a device that was reset sends nothing."""
IDLE_QUIET_US = 200_000
"""As `QUIET_US`, for a device that streams nothing: an idle link costs only these pings."""
STREAM_US = 500_000
"""A device is not streaming if no state came for this long while other messages did."""
QUIET_PERIOD_US = 25_000
"""Between pings until something is received."""


class Liveness:
    """When the device of a session that began at `now_us` was last heard.

    Attributes:
        heard_us: When anything of this session last came.
        state_us: When the last state frame came.
    """

    __slots__ = ("heard_us", "state_us")

    def __init__(self, now_us: int) -> None:
        self.heard_us = self.state_us = now_us

    @property
    def silent_us(self) -> int:
        """When the device starts to count as silent, if nothing more comes."""
        return self.heard_us + SILENCE_US

    def ping_due_us(self, pinged_us: int) -> int:
        """When to ping, if nothing comes until then; `pinged_us`: when it was pinged last."""
        # A device that streams is expected to be heard, so its silence is looked into sooner.
        streams = self.heard_us < self.state_us + STREAM_US
        quiet_us = self.heard_us + (QUIET_US if streams else IDLE_QUIET_US)
        # An answer may be on its way: a busy device must not be flooded.
        return max(quiet_us, pinged_us + QUIET_PERIOD_US)
