"""What duty a robot's wheels need: breakaway, speed over duty, and how fast they follow.

Open loop, by duty setpoints alone, so it needs no gains. The wheels must count in the direction of
the drive. Three measurements, in both directions, both wheels at a time:

1. Breakaway: the duty rises slowly until a wheel starts to turn.
2. Steps between two duties at which the wheels turn, so that friction does not change on the way:
   delay and time constant of speed over duty.
3. A staircase: the speed at each duty, counted over whole turns where there is time for them. It
   goes up and down if the robot is raised; on the floor it drives forward and back at each duty.

The staircase's least-squares line gives the feed-forwards of the velocity loop, `duty = static +
velocity_feedforward * speed`. Breakaway is not used for it: a turning wheel needs less.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import mean, median
from typing import TypeAlias

from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from ...errors import CommissioningFailed
from ...robot.robot import Robot
from . import driving
from .driving import SIDES, Pair, Record, ShowTimeLeft
from .fits import Edge, FirstOrder, Line, fit_first_order, fit_line
from .problems import MAGNET_MISSING, Problem

STAIRS = (0.15, 0.60)
"""The staircase's lowest and highest duty."""
STAIR = 0.05

_RAMP_PER_S = 0.06
"""How fast the duty rises until a wheel breaks away."""
_BREAKAWAY_RAD = math.radians(5)
"""A wheel that turns as far as this has broken away: play of a gearbox is less."""
_BREAKAWAY_ROUNDS = 2
_MOST_BREAKAWAY = 0.44

_USUAL_BREAKAWAY_S = 10.0
"""Usual time for all rounds."""
_STEPS_S = 4.2
"""Time for the step response in both directions."""
_EDGE_S = 0.6
"""Each duty of the step response."""
_SETTLED = 5.5
"""Time constants until a speed is steady: 0.4 % are left."""
_MEASURED_S = 0.6
_LONGEST_TURN_S = 2.0
"""A turn that takes longer is not waited for."""
_LONGEST_WAY_M = 0.75
"""Longest way of one run on the floor."""
_FEWEST_STAIRS = 4
_FEWEST_TICKS = 4
"""With less than that at a duty, a wheel stands."""

_BENT = 0.05
"""A line further off than this fraction of the greatest speed does not describe the curve."""
_HEADROOM = 0.9
"""Fraction of full duty; the rest is for the loop."""
_FEWEST_GAPS = 2
"""An encoder is faulty if its counts have gaps at this many duties: one may be an obstacle."""
_UNEQUAL = 0.15
"""Difference between wheels or directions, as a fraction, that is worth a word."""


@dataclass(frozen=True)
class WheelIdentification:
    """The results of one wheel, both directions together.

    Attributes:
        static_feedforward: Where the line of speed over duty meets standstill. [duty]
        velocity_feedforward: The line's rise. [duty per m/s]
        breakaway: Duty that starts the wheel from rest.
        curve: The staircase, as pairs of duty and speed [m/s].
        nonlinearity: Why no line describes the curve; empty if one does.
        delay_s: From a change of duty to the measured velocity, its own lag included. None: the
            steps could not be measured.
        time_constant_s: Time constant of the speed; raised, it lacks the robot's mass.
    """

    static_feedforward: float
    velocity_feedforward: float
    breakaway: float
    curve: tuple[tuple[float, float], ...]
    nonlinearity: str
    delay_s: float | None
    time_constant_s: float | None


@dataclass(frozen=True)
class Identification:
    """The results of a robot.

    Attributes:
        left: The left wheel.
        right: The right wheel.
        on_the_floor: The time constants are the whole robot's.
        supply_v: The battery while the wheels turned; None if it is not measured. [V]
        problems: In words, each with what to do.
    """

    left: WheelIdentification
    right: WheelIdentification
    on_the_floor: bool
    supply_v: float | None
    problems: tuple[str, ...]

    @property
    def static_feedforward(self) -> float:
        """Mean of both wheels, which share the parameter."""
        return mean((self.left.static_feedforward, self.right.static_feedforward))

    @property
    def velocity_feedforward(self) -> float:
        """Mean of both wheels, which share the parameter, in duty per m/s."""
        return mean((self.left.velocity_feedforward, self.right.velocity_feedforward))

    @property
    def delay_s(self) -> float | None:
        """The longer one of both wheels."""
        return _both(max, self.left.delay_s, self.right.delay_s)

    @property
    def time_constant_s(self) -> float | None:
        """The mean of both wheels."""
        return _both(mean, self.left.time_constant_s, self.right.time_constant_s)


def identify(
    robot: Robot,
    report: Callable[[str], None],
    *,
    on_the_floor: bool,
    left: ShowTimeLeft = driving.show_nothing,
) -> Identification:
    """Measure what duty the wheels need. The robot is stopped at the end, whatever happens.

    It takes about a minute. Raised, the wheels turn at up to 0.6 of duty for some seconds at a
    time; on the floor the robot drives back and forth, and needs a metre ahead of it.

    Args:
        robot: Its wheels turn and count in the direction of the drive, and `counts_per_revolution`
            and `wheel_radius` are set.
        report: Called with a sentence on what is done now.
        on_the_floor: Whether it stands on its wheels.
        left: Called with about how long the wheels still turn [s].

    Raises:
        CommissioningFailed: A wheel does not turn, or counts backward; an e-stop or a fault is
            latched; the board was reset, or the link was lost for a while.
        DeviceRefused: An e-stop or a fault was latched during the measurement.
        LinkLost: The robot is out of reach.
        RequestTimeout: It is in reach, but does not answer.
    """
    driving.require_ready(robot)
    bench = _Bench(robot, report, on_the_floor, left)
    # Each record checks itself alone: a reset between two of them shows in the sessions only.
    with driving.one_session(robot):
        try:
            return bench.identify()
        finally:
            robot.stop()
            left(0.0)


_Stairs: TypeAlias = list[tuple[float, float]]
"""The steady speeds of one wheel, each with its duty and their signs: duty first."""


def _curve(stairs: _Stairs, *signs: int) -> tuple[tuple[float, float], ...]:
    """Each duty once, without its sign, in these directions."""
    speeds: dict[float, list[float]] = {}
    # A duty may have several points: on the way up and down, and in both directions.
    for duty, speed in stairs:
        if math.copysign(1, duty) in signs:
            speeds.setdefault(round(abs(duty), 6), []).append(abs(speed))
    return tuple((duty, mean(found)) for duty, found in sorted(speeds.items()))


class _Bench:
    """One run of the measurements."""

    def __init__(
        self, robot: Robot, report: Callable[[str], None], on_the_floor: bool, left: ShowTimeLeft
    ) -> None:
        self._robot = robot
        self._report = report
        self._on_the_floor = on_the_floor
        self._left = left
        values = robot.parameters
        self._counts = values["counts_per_revolution"]
        self._m_per_tick = 2 * math.pi * values["wheel_radius"] / self._counts
        self._rate_per_s = values["max_duty_rate_per_s"]
        self._most_duty = values["max_duty"]
        # Below the duty at which a standing wheel trips a fault.
        self._most_breakaway = min(_MOST_BREAKAWAY, 0.98 * values["stall_duty"], self._most_duty)
        self._supply: list[float] = []
        self._gaps = [0, 0]
        # Assumed if the steps cannot be measured: a slow drive, so that each stair settles.
        self._time_constant_s = 0.15

    def identify(self) -> Identification:
        # In this order: the steps need the breakaway, and the stairs need both it and the lag.
        count = len(_duties(*STAIRS))
        stairs_s = self._stair_s() * (count if self._on_the_floor else 4 * count - 2)
        self._left(_USUAL_BREAKAWAY_S + _STEPS_S + stairs_s)
        self._report("breakaway: the duty rises slowly until the wheels start to turn")
        breakaway = self._breakaway()
        self._left(_STEPS_S + stairs_s)
        self._report("step response: how fast the wheels follow a change of duty")
        lags = self._step_response(max(breakaway))
        # The slower wheel decides how long each stair settles.
        known = [lag.time_constant_s for lag in lags if lag]
        if known:
            self._time_constant_s = max(known)
        self._report("staircase: the speed at each duty, in both directions")
        stairs = self._staircase(breakaway)
        wheels = tuple(
            self._wheel(*found) for found in zip(SIDES, breakaway, stairs, lags, strict=True)
        )
        supply_v = median(self._supply) if self._supply else None
        gaps = [side for side in (0, 1) if self._gaps[side] >= _FEWEST_GAPS]
        return Identification(
            left=wheels[0],
            right=wheels[1],
            on_the_floor=self._on_the_floor,
            supply_v=supply_v,
            problems=(
                *(str(Problem(MAGNET_MISSING, side)) for side in gaps),
                *_problems(wheels, stairs),
                *self._too_fast(wheels),
            ),
        )

    # --- breakaway -----------------------------------------------------------------------------

    def _breakaway(self) -> Pair:
        found: list[Pair] = []
        for _ in range(_BREAKAWAY_ROUNDS):
            # Alternately, so that a robot on the floor stays where it is.
            for sign in (1, -1):
                driving.come_to_rest(self._robot)
                found.append(self._breakaway_towards(sign))
        # Friction at rest differs from start to start and with the direction.
        return Pair(*(median(side) for side in zip(*found, strict=True)))

    def _breakaway_towards(self, sign: int) -> Pair:
        """Both wheels at once; one that has started is let go."""
        # With few counts per turn, 5 degrees are hardly more than an encoder at rest may toggle.
        ramps = _Ramps(sign, max(4.0, _BREAKAWAY_RAD / (2 * math.pi) * self._counts))
        driving.follow_duty(
            self._robot,
            ramps.duty,
            lambda _: None not in ramps.broken,
            lambda record: record.seconds * _RAMP_PER_S > self._most_breakaway,
        )
        for wheel, duty in zip(SIDES, ramps.broken, strict=True):
            if duty is None:
                raise CommissioningFailed(
                    f"the {wheel} wheel does not start to turn up to duty "
                    f"{self._most_breakaway:.2f}: the loop cannot hold a weaker motor, so "
                    "setup does not tune it; check that the wheel is free, its supply and its"
                    " motor"
                )
            if duty < 0:
                raise CommissioningFailed(
                    f"the {wheel} wheel counts backward when it is driven forward: correct the "
                    "wiring first, with `wheelwire setup`"
                )
        return Pair(*(duty or 0.0 for duty in ramps.broken))

    # --- step response -------------------------------------------------------------------------

    def _step_response(self, breakaway: float) -> list[FirstOrder | None]:
        # Clear of breakaway, so that the lower duty keeps both wheels turning; and at least 0.2
        # apart, so that the step stands out from the noise of the measured speed.
        low = 1.3 * breakaway
        high = min(self._most_duty, max(STAIRS[1], low + 0.2))
        records = driving.uninterrupted(lambda: self._steps_both_ways(low, high))
        edges: tuple[list[Edge], list[Edge]] = [], []
        for sign, record in records.items():
            for wheel, found in enumerate(edges):
                found += self._edges(record, wheel, sign * low, sign * high)
        # Up and down, forward and backward: an edge that is missing would leave a one-sided fit.
        ramp_s = abs(high - low) / self._rate_per_s
        return [fit_first_order(found, ramp_s) if len(found) == 4 else None for found in edges]

    def _steps_both_ways(self, low: float, high: float) -> dict[int, Record] | None:
        """Up and down again, forward and then back."""
        records = {}
        for sign in (1, -1):
            driving.come_to_rest(self._robot)
            records[sign] = self._steps([sign * low, sign * high, sign * low])
        # The fit takes a while: the wheels must not turn until the last setpoint expires.
        driving.come_to_rest(self._robot)
        return None if any(record.lapsed for record in records.values()) else records

    def _steps(self, duties: Sequence[float]) -> Record:
        """All duties in one record, each for the same time."""

        def duty(record: Record) -> Pair:
            index = min(int(record.seconds / _EDGE_S), len(duties) - 1)
            return Pair(duties[index], duties[index])

        end_s = _EDGE_S * len(duties)
        return driving.follow_duty(self._robot, duty, lambda record: record.seconds >= end_s)

    def _edges(self, record: Record, wheel: int, low: float, high: float) -> list[Edge]:
        """The parts of the record around the two changes of duty."""
        times = record.times_s()
        duties = [driving.duty_of(sample, wheel) for sample in record.samples]
        speeds = [(sample.left_mps, sample.right_mps)[wheel] for sample in record.samples]
        found: list[Edge] = []
        for number, (start, end) in enumerate(((low, high), (high, low)), 1):
            # When a setpoint was sent is known, but not when the robot obeyed it.
            begin = self._ramp_begin(times, duties, start, end, number * _EDGE_S)
            if begin is None:
                continue
            # From before the edge, because the earlier speed is fitted as well, to before the next
            # edge.
            chosen = [
                (time - begin, speed)
                for time, speed in zip(times, speeds, strict=True)
                if begin - 0.15 <= time <= begin + _EDGE_S - 0.03
            ]
            found.append(chosen)
        return found

    def _ramp_begin(
        self,
        times: Sequence[float],
        duties: Sequence[float],
        start: float,
        end: float,
        about_s: float,
    ) -> float | None:
        """When the output left `start`: the slew limit says so from any sample on the ramp."""
        for before, time, duty in zip(times, times[1:], duties[1:], strict=False):
            # Further back is the ramp from standstill, or the edge before this one.
            if before < about_s - 0.05 or abs(duty - start) < 0.01:
                continue
            ramp_s = abs(duty - start) / self._rate_per_s
            # A sample at the end may be late by all of the time since the one before.
            late_s = 0.0 if abs(duty - end) > 0.01 else max(0.0, time - before - ramp_s) / 2
            return time - ramp_s - late_s
        return None

    # --- staircase -----------------------------------------------------------------------------

    def _staircase(self, breakaway: Pair) -> tuple[_Stairs, _Stairs]:
        stairs: tuple[_Stairs, _Stairs] = [], []
        lowest, highest = STAIRS
        # With much friction the stairs go higher, so that enough of them are beyond breakaway.
        highest = min(self._most_duty, max(highest, max(breakaway) + 0.3))
        duties = _duties(lowest, highest)
        if self._on_the_floor:
            self._back_and_forth(duties, 1.2 * max(breakaway), stairs)
        else:
            self._up_and_down(duties, 1.05 * max(breakaway), stairs)
        # A line through two or three points would hide that the curve is bent.
        for wheel, found in zip(SIDES, stairs, strict=True):
            turned = min(len(_curve(found, sign)) for sign in (1, -1))
            if turned < _FEWEST_STAIRS:
                raise CommissioningFailed(
                    f"the {wheel} wheel turns at {turned} of {len(duties)} duties up to "
                    f"{highest:.2f}: check its motor, what rubs, and the supply"
                )
        return stairs

    def _up_and_down(
        self, duties: Sequence[float], start: float, stairs: tuple[_Stairs, _Stairs]
    ) -> None:
        """Up from where the wheels start to turn, down to the lowest."""
        up = [duty for duty in duties if duty >= start]
        for sign in (1, -1):
            driving.come_to_rest(self._robot)
            # Below breakaway a wheel turns only if it turned before: these duties are measured on
            # the way down alone.
            way = (*up, *reversed(duties[:-1]))
            for climbed, duty in enumerate(way):
                runs = len(way) * (2 if sign > 0 else 1) - climbed
                self._left(self._stair_s() * runs)
                points = driving.uninterrupted(partial(self._stair, sign * duty))
                self._add(points, sign * duty, stairs)
        driving.come_to_rest(self._robot)

    def _back_and_forth(
        self, duties: Sequence[float], kick: float, stairs: tuple[_Stairs, _Stairs]
    ) -> None:
        """Each duty forward and back, so that the robot stays where it is."""
        for done, duty in enumerate(reversed(duties)):
            self._left(self._stair_s() * (len(duties) - done))
            forward, backward = driving.uninterrupted(partial(self._there_and_back, duty, kick))
            self._add(forward, duty, stairs)
            self._add(backward, -duty, stairs)
        driving.come_to_rest(self._robot)

    def _stair_s(self) -> float:
        """About how long a stair takes: on the floor both ways, with the rests between."""
        run_s = _SETTLED * self._time_constant_s + 0.1 + _MEASURED_S
        return 2 * (run_s + 4 * driving.STANDSTILL_S) if self._on_the_floor else run_s

    def _there_and_back(self, duty: float, kick: float) -> tuple[Pair, Pair] | None:
        speeds = []
        for sign in (1, -1):
            driving.come_to_rest(self._robot)
            # A duty below breakaway keeps a wheel turning, but does not start it.
            if duty < kick:
                driving.hold_duty(self._robot, Pair(sign * kick, sign * kick), 0.15)
            speeds.append(self._stair(sign * duty))
        forward, backward = speeds
        # Both ways are repeated if one of them failed, so that the robot stays where it is.
        return None if forward is None or backward is None else (forward, backward)

    def _add(self, speeds: Pair, duty: float, stairs: tuple[_Stairs, _Stairs]) -> None:
        for found, speed in zip(stairs, speeds, strict=True):
            if speed * duty > 0:  # a wheel that stands still is not part of the curve
                found.append((duty, speed))

    def _stair(self, duty: float) -> Pair | None:
        """The steady speeds in m/s at one duty; None if a setpoint expired."""
        # 0.1 s more for the link and for the ramp of the duty.
        settle_s = _SETTLED * self._time_constant_s + 0.1
        both = Pair(duty, duty)
        settling = driving.hold_duty(self._robot, both, settle_s)
        record = driving.follow_duty(self._robot, lambda _: both, self._is_enough(settle_s))
        if settling.lapsed or record.lapsed:
            return None
        for side in (0, 1):
            self._gaps[side] += driving.has_gap(record.samples, side)
        # While the wheels turn: the feed-forward will hold at the voltage of a loaded battery.
        self._supply += [sample.battery_v for sample in record.samples if sample.battery_v]
        return Pair(self._speed_mps(record, 0), self._speed_mps(record, 1))

    def _speed_mps(self, record: Record, wheel: int) -> float:
        travel = record.travel(wheel)
        if abs(travel[-1]) < _FEWEST_TICKS:
            return 0.0
        return self._m_per_tick * steady_rate(record.times_s(), travel, round(self._counts))

    def _is_enough(self, settle_s: float) -> Callable[[Record], bool]:
        """Long enough for whole turns if raised, no further than there is floor."""

        def enough(record: Record) -> bool:
            turned = min(map(abs, record.ticks)) / self._counts
            if self._on_the_floor:
                # The record leaves out the way of the settling, at about the same speed.
                way_m = max(map(abs, record.ticks)) * self._m_per_tick
                whole_way_m = way_m * (1 + settle_s / max(record.seconds, 1e-3))
                return record.seconds >= _MEASURED_S or whole_way_m > _LONGEST_WAY_M
            if record.seconds < _MEASURED_S:
                return False
            # At this rate, would the turn take too long?
            slow = turned / record.seconds < 1 / _LONGEST_TURN_S
            return slow or turned >= 1.02

        return enough

    # --- the result ----------------------------------------------------------------------------

    def _wheel(
        self, name: str, breakaway: float, stairs: _Stairs, lag: FirstOrder | None
    ) -> WheelIdentification:
        curve = _curve(stairs, 1, -1)
        line = fit_line(curve)
        if not line.slope > 0:
            raise CommissioningFailed(
                f"the {name} wheel does not turn faster at a higher duty: check its motor and the "
                "supply"
            )
        return WheelIdentification(
            static_feedforward=within("static_feedforward", line.offset),
            velocity_feedforward=within("velocity_feedforward", 1 / line.slope),
            breakaway=breakaway,
            curve=curve,
            nonlinearity=_nonlinearity(curve, line),
            delay_s=lag.delay_s if lag else None,
            time_constant_s=lag.time_constant_s if lag else None,
        )

    def _too_fast(self, wheels: Sequence[WheelIdentification]) -> list[str]:
        """Whether the robot's own limit leaves the loop nothing to correct with."""
        most_duty = _HEADROOM * self._most_duty
        # The slower wheel decides: the limit is the same for both.
        reached = min(
            (most_duty - wheel.static_feedforward) / wheel.velocity_feedforward for wheel in wheels
        )
        limit = self._robot.parameters["max_velocity_mps"]
        if limit <= reached:
            return []
        return [
            f"max_velocity_mps is {limit:.2f}, but at {most_duty:.2f} of duty the wheels turn at "
            f"{reached:.2f} m/s: set it to that or less, or the loop has nothing to correct with"
        ]


def _duties(lowest: float, highest: float) -> list[float]:
    """The duties of a staircase."""
    # Rounded up, the last one would be more than the robot allows, and off the curve.
    count = int((highest - lowest) / STAIR + 1e-9)
    return [lowest + STAIR * step for step in range(count + 1)]


class _Ramps:
    """The duties of two wheels that rise until each of them turns."""

    def __init__(self, sign: int, far_ticks: float) -> None:
        self.broken: list[float | None] = [None, None]
        """Duty at which each wheel started; negative if it started in the wrong direction."""
        self._sign = sign
        self._far_ticks = far_ticks
        self._first_move: list[float | None] = [None, None]

    def duty(self, record: Record) -> Pair:
        """The duties now."""
        duty = _RAMP_PER_S * record.seconds
        for wheel, travelled in enumerate(record.ticks):
            ticks = travelled * self._sign
            # A single tick may be an encoder that toggles at rest, so a first move is dropped again
            # when the count returns.
            if abs(ticks) < 2:
                self._first_move[wheel] = None
            elif self._first_move[wheel] is None:
                self._first_move[wheel] = duty
            # The duty of the first move counts: it rises further on the way to `far_ticks`.
            first = self._first_move[wheel]
            if self.broken[wheel] is None and first is not None and abs(ticks) >= self._far_ticks:
                self.broken[wheel] = first if ticks > 0 else -first
        # One that turns would only gain speed while the duty rises for the other one.
        left, right = (0.0 if broken is not None else self._sign * duty for broken in self.broken)
        return Pair(left, right)


def steady_rate(times_s: Sequence[float], ticks: Sequence[int], counts: int) -> float:
    """Ticks per second of a wheel that turns steadily.

    Over whole turns if there is one: what repeats each turn, such as an eccentric disc, drops out.

    Args:
        times_s: Times of the samples.
        ticks: Travelled at each sample, 0 at the first one.
        counts: Ticks per turn.
    """
    turns = abs(ticks[-1]) // counts
    if turns == 0:
        return ticks[-1] / times_s[-1]
    goal = turns * counts
    # The last whole turn ended between two samples.
    index = next(number for number, travelled in enumerate(ticks) if abs(travelled) >= goal)
    before, after = abs(ticks[index - 1]), abs(ticks[index])
    share = (goal - before) / (after - before)
    seconds = times_s[index - 1] + share * (times_s[index] - times_s[index - 1])
    return math.copysign(goal / seconds, ticks[-1])


def _nonlinearity(curve: Sequence[tuple[float, float]], line: Line) -> str:
    # A negative offset would mean that a wheel turns without any duty: then the curve is bent,
    # however close the line is to its points.
    if line.deviation <= _BENT and line.offset >= 0:
        return ""
    middle = len(curve) // 2
    lower = fit_line(curve[: middle + 1]).slope
    upper = fit_line(curve[middle:]).slope
    return (
        f"speed over duty is not a straight line: it rises by {lower:.2f} m/s per duty below duty "
        f"{curve[middle][0]:.2f} and by {upper:.2f} above; the line is off by up to "
        f"{line.deviation:.0%} of the greatest speed"
    )


def _problems(wheels: Sequence[WheelIdentification], stairs: Sequence[_Stairs]) -> tuple[str, ...]:
    found = []
    for name, wheel, points in zip(SIDES, wheels, stairs, strict=True):
        if wheel.nonlinearity:
            found.append(
                f"{name} wheel: {wheel.nonlinearity}. A higher pwm_frequency_hz makes it straighter"
            )
        forward, backward = (fit_line(_curve(points, sign)).slope for sign in (1, -1))
        if _differ(forward, backward):
            found.append(
                f"{name} wheel: {forward:.2f} m/s per duty forward, {backward:.2f} backward: "
                "check its bridge and what rubs"
            )
    left, right = (1 / wheel.velocity_feedforward for wheel in wheels)
    if _differ(left, right):
        found.append(
            f"the motors are unequal: left {left:.2f}, right {right:.2f} m/s per duty. The "
            "feed-forward is their mean, the loop corrects the rest"
        )
    return tuple(found)


def _differ(a: float, b: float) -> bool:
    return abs(a - b) > _UNEQUAL * max(a, b)


def within(name: str, value: float) -> float:
    """The value, or the bound of the parameter that is nearest to it."""
    parameter = PARAMETER_BY_NAME[name]
    return min(max(value, parameter.minimum), parameter.maximum)


def _both(
    combine: Callable[[tuple[float, float]], float], left: float | None, right: float | None
) -> float | None:
    return None if left is None or right is None else combine((left, right))
