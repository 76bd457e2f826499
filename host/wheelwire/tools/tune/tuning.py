"""A short drive with other gains, compared with the same drive with the robot's own."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from wheelwire_protocol.codes import Fault

from ...errors import InvalidArgument
from ...robot.robot import Robot
from ..setup.driving import SIDES, Pair, ShowTimeLeft, require_ready, show_nothing
from .before_after import Course, Piece, Trace, drive_with_each, means, noise_mps

STEP, RAMP, SINE = SHAPES = ("step", "ramp", "sine")
BOTH = "both"
WHEELS = (*SIDES, BOTH)

_SINE_PERIODS = 2
_SINE_PARTS = 24
"""Straight pieces of a period: they differ from the sine by 1 % of its height."""
_REST_S = 0.3
"""Time at the end in which the loop brings the wheels to rest."""
_SHORTEST_HOLD_S = 0.2
"""Shortest hold of a step: less shows nothing."""
_STEEPEST = 0.95
"""Fraction of max_acceleration_mps2, so that the drive does not measure the limit itself."""
_FURTHER = 1.1
"""A wheel that gets further than asked by this is stopped."""
_SETTLED = 0.05
"""Fraction of a step: the speed has settled once it stays that close."""


@dataclass(frozen=True)
class Drive:
    """What to drive.

    Attributes:
        shape: `step`: to the speed, and back to rest. `ramp`: up to it and down, both slowly.
            `sine`: between it and the same speed backward, twice.
        wheel: `left`, `right` or `both`; the other wheel is held.
        speed_mps: The greatest; negative: backward first.
        seconds: For how long at most.
        distance_m: How far from where it begins a wheel gets at most.
    """

    shape: str = STEP
    wheel: str = BOTH
    speed_mps: float = 0.2
    seconds: float = 3.0
    distance_m: float = 0.5

    @property
    def wheels(self) -> tuple[int, ...]:
        """The indices of the `SIDES` that are driven."""
        return (0, 1) if self.wheel == BOTH else (SIDES.index(self.wheel),)

    @property
    def top_mps(self) -> float:
        """The greatest speed, in either direction."""
        return abs(self.speed_mps)

    @property
    def moving_s(self) -> float:
        """Time in seconds without the rest at its end."""
        return self.seconds - _REST_S


def course_of(drive: Drive, robot: Robot) -> Course:
    """The course of a drive, as long as its seconds and its distance allow.

    Raises:
        InvalidArgument: The robot is not to drive as fast, or the time or the distance is too
            little for the speed.
        LinkLost: The robot is out of reach.
    """
    most_mps = robot.parameters["max_velocity_mps"]
    if drive.top_mps > most_mps:
        raise InvalidArgument(
            f"{drive.speed_mps:g} m/s is beyond the robot's max_velocity_mps, {most_mps:g} m/s: "
            "give less"
        )
    ramp_mps2 = _STEEPEST * robot.parameters["max_acceleration_mps2"]
    pieces = {STEP: _step, RAMP: _ramp, SINE: _sine}[drive.shape](drive, ramp_mps2)
    return Course(drive.top_mps, pieces, longest_way_m=_FURTHER * drive.distance_m)


def _step(drive: Drive, ramp_mps2: float) -> Iterator[Piece]:
    ramp_s = drive.top_mps / ramp_mps2
    # Both ramps together go as far as one that is held for as long.
    hold_s = min(drive.moving_s - 2 * ramp_s, drive.distance_m / drive.top_mps - ramp_s)
    _check(drive, hold_s >= _SHORTEST_HOLD_S)
    yield _piece(drive, 1.0, ramp_s, hold_s)
    yield _piece(drive, 0.0, ramp_s, _REST_S)


def _ramp(drive: Drive, ramp_mps2: float) -> Iterator[Piece]:
    half_s = min(drive.moving_s / 2, drive.distance_m / drive.top_mps)
    _check(drive, half_s > 0 and drive.top_mps / half_s <= ramp_mps2)
    yield _piece(drive, 1.0, half_s, 0.0)
    yield _piece(drive, 0.0, half_s, _REST_S)


def _sine(drive: Drive, ramp_mps2: float) -> Iterator[Piece]:
    # In half a period a sine goes top * period / pi.
    period_s = min(drive.moving_s / _SINE_PERIODS, math.pi * drive.distance_m / drive.top_mps)
    _check(drive, period_s > 0 and 2 * math.pi * drive.top_mps / period_s <= ramp_mps2)
    count = _SINE_PERIODS * _SINE_PARTS
    for number in range(1, count + 1):
        height = math.sin(2 * math.pi * number / _SINE_PARTS)
        rest_s = _REST_S if number == count else 0.0
        yield _piece(drive, height, period_s / _SINE_PARTS, rest_s)


def _check(drive: Drive, is_enough: bool) -> None:
    if not is_enough:
        raise InvalidArgument(
            f"a {drive.shape} to {drive.speed_mps:g} m/s does not fit into {drive.seconds:g} s and "
            f"{drive.distance_m:g} m: give less speed, or more of both"
        )


def _piece(drive: Drive, height: float, ramp_s: float, hold_s: float) -> Piece:
    """A piece of the course that ends at this fraction of the drive's speed."""
    speed = height * drive.speed_mps
    held = Pair(*(speed if wheel in drive.wheels else 0.0 for wheel in (0, 1)))
    return held, ramp_s, hold_s


@dataclass(frozen=True)
class Tracking:
    """How one wheel followed a drive. None where the shape shows no such figure, or it never came.

    Attributes:
        rms_mps: Root mean square of the difference to what was commanded. [m/s]
        rise_s: From a tenth to nine tenths of a step. [s]
        overshoot: Beyond a step, as a fraction of it.
        settling_s: From a step's beginning until the speed stays within 5 % of it. [s]
    """

    rms_mps: float
    rise_s: float | None = None
    overshoot: float | None = None
    settling_s: float | None = None


def tracking(trace: Trace, course: Course, drive: Drive, wheel: int) -> Tracking:
    """The figures of one wheel."""
    rms_mps = trace.rms_mps(wheel)
    if drive.shape != STEP:
        return Tracking(rms_mps)
    # By the moments that the velocities are about, until the step ends.
    up = course.parts[0]
    share = [
        (time - trace.lag_s, pair[wheel] / drive.speed_mps)
        for time, pair in zip(trace.times_s, trace.measured, strict=True)
        if 0.0 <= time - trace.lag_s < up.end_s
    ]
    times, values = zip(*share, strict=True)
    points = list(zip(means(times), means(values), strict=True))
    low, high = (_crossing(points, level) for level in (0.1, 0.9))
    outside = [time for time, value in points if abs(value - 1.0) > _SETTLED]
    last_s = points[-1][0]
    return Tracking(
        rms_mps,
        rise_s=None if low is None or high is None else high - low,
        overshoot=max(0.0, *(value - 1.0 for _, value in points)),
        settling_s=outside[-1] if outside and outside[-1] < last_s else None,
    )


def _crossing(points: Sequence[tuple[float, float]], level: float) -> float | None:
    """When a value is first reached."""
    if points[0][1] >= level:
        return points[0][0]
    for (begin_s, low), (end_s, high) in pairwise(points):
        if low < level <= high:
            return begin_s + (end_s - begin_s) * (level - low) / (high - low)
    return None


@dataclass(frozen=True)
class Comparison:
    """One drive, or two: with the previous values, and with the tried ones.

    Attributes:
        drive: What was driven.
        seconds: How long it took.
        traces: One of each drive; None where a fault ended it.
        figures: By drive and wheel; None where a fault ended it.
        faults: That ended each drive.
        held_up: This computer was held up in a drive, which therefore says little about the
            values: see `Trace.is_held_up`.
    """

    drive: Drive
    seconds: float
    traces: tuple[Trace | None, ...]
    figures: tuple[Mapping[str, Tracking] | None, ...]
    faults: tuple[Fault, ...]
    held_up: bool

    @property
    def titles(self) -> tuple[str, ...]:
        """The title of each drive."""
        return ("before", "after")[: len(self.traces)]

    @property
    def sides(self) -> tuple[str, ...]:
        """The wheels that were driven."""
        return tuple(SIDES[wheel] for wheel in self.drive.wheels)

    @property
    def gain_mps(self) -> float | None:
        """How much smaller the tracking error became; None if a fault ended a drive."""
        if len(self.traces) < 2 or not all(self.traces):
            return None
        before, after = (trace.rms_mps(*self.drive.wheels) for trace in self.traces if trace)
        return before - after

    @property
    def is_worse(self) -> bool:
        """A fault ended the drive with the tried values, or they track worse beyond the noise."""
        if self.faults[-1]:
            return True
        gain_mps = self.gain_mps
        return gain_mps is not None and gain_mps < -self.noise_mps

    @property
    def noise_mps(self) -> float:
        """What a difference between the drives may be by chance."""
        return noise_mps(self.traces, *self.drive.wheels)


def compare(
    robot: Robot,
    drive: Drive,
    tried: Mapping[str, float],
    left: ShowTimeLeft = show_nothing,
    plan: Callable[[Course], object] = lambda _: None,
) -> Comparison:
    """Drive with the robot's values and then with those to be tried, if any.

    At the end, whatever happens, the robot stands and has its previous values again. In a trial of
    parameters a lost link reverts them, too.

    Args:
        robot: Raised, or with room around it.
        drive: What to drive.
        tried: Parameters by name, such as gains.
        left: Called with about how long the wheels still turn [s].
        plan: Called with the course before anything moves.

    Raises:
        InvalidArgument: As `course_of`.
        CommissioningFailed, DeviceRefused, LinkLost: As `before_after.prove`; or a wheel turned too
            far.
    """
    require_ready(robot)
    course = course_of(drive, robot)
    plan(course)
    before = {name: robot.parameters[name] for name in tried}
    traces, faults = drive_with_each(robot, (before, tried) if tried else (before,), course, left)
    figures = tuple(
        {SIDES[wheel]: tracking(trace, course, drive, wheel) for wheel in drive.wheels}
        if trace
        else None
        for trace in traces
    )
    held_up = any(trace.is_held_up(course) for trace in traces if trace)
    return Comparison(drive, course.seconds, traces, figures, faults, held_up)
