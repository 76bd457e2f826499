"""The same short drive with the parameters before and after: tracking errors side by side.

The commanded velocities are ramps within the acceleration limit, so that what is measured is the
loop's error and not the limit's: ahead and back, turns, a curve, crawling. At its end the robot is
about where it began. It takes a metre of floor, or none if the wheels are raised.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from statistics import median
from typing import NamedTuple, TypeAlias

from wheelwire_protocol.codes import Fault

from ...errors import CommissioningFailed, DeviceRefused, InvalidArgument
from ...robot.robot import Robot
from ...whole_file import save_figure
from ..setup import driving
from ..setup.driving import SIDES, Pair, Record, ShowTimeLeft

TOP_MPS = 0.35
"""Speed in the fastest part of the drive, on a robot that reaches it."""
RAMP_MPS2 = 1.0
"""Acceleration on the steepest ramp, on a robot that may have it."""

_LONGEST_WAY_M = 0.75
_DUTY_AT_TOP = 0.7
"""Fraction of the robot's duty limit at constant speed."""
_DUTY_OF_RAMP = 0.3
"""Fraction of the robot's duty limit for the acceleration."""
_MEASUREMENT_LAG = 0.65
"""Lag of the measured velocity, in `velocity_window_us`; the firmware assumes the same."""
_SHORTEST_HOLD_S = 0.4
"""A part of the drive that is held for less shows no overshoot."""
_SMALLEST_STEP = 0.3
"""Nor does a step smaller than this fraction of the top speed."""
_JUMP = 0.25
"""Change of the commanded velocity between two setpoints, as a fraction of the top speed, that
makes the drive another one: a step's tracking error grows by a tenth to a half."""
_ATTEMPTS = 3
"""Most drives of a course that ends where it began, before one is not held up by this computer."""
_LATE = 3.0
"""So many times as long as usual between two samples: this computer was held up."""
_NOISE_SAMPLES = 3
"""Overshoot is measured on the mean of this many samples."""

_PARTS = (
    (1.0, 1.0, 0.8),
    (0.4, 0.4, 0.5),
    # Through zero without a rest, where friction changes its sign.
    (-1.0, -1.0, 0.8),
    (-0.4, -0.4, 0.5),
    (0.0, 0.0, 0.3),
    (-0.5, 0.5, 0.5),
    (0.5, -0.5, 0.5),
    (0.0, 0.0, 0.3),
    (1.0, 0.5, 0.5),
    (-1.0, -0.5, 0.5),
    (0.0, 0.0, 0.3),
    # Crawling, where static friction decides.
    (0.12, 0.12, 1.0),
    (-0.12, -0.12, 1.0),
    (0.0, 0.0, 0.3),
)
"""Left and right in parts of the top speed, and for how long that is held [s], after a ramp."""


class Part(NamedTuple):
    """A part of the drive: a ramp, then a constant velocity."""

    begin_s: float
    held_from_s: float
    end_s: float
    before: Pair
    """The velocities at its beginning. [m/s]"""
    held: Pair
    """The velocities that are held. [m/s]"""


Piece: TypeAlias = tuple[Pair, float, float]
"""The velocities to hold [m/s], and for how long they are approached, then held [s]."""


class Course:
    """The commanded velocity of both wheels over time.

    Args:
        top_mps: The greatest speed.
        pieces: One after the other, from standstill.
        longest_way_m: A wheel that gets further from where it began is stopped.
    """

    def __init__(
        self, top_mps: float, pieces: Iterable[Piece], longest_way_m: float = math.inf
    ) -> None:
        self.top_mps = top_mps
        self.parts: list[Part] = []
        self.longest_way_m = longest_way_m
        end_s, before = 0.0, Pair(0.0, 0.0)
        for held, ramp_s, hold_s in pieces:
            held_from_s = end_s + ramp_s
            self.parts.append(Part(end_s, held_from_s, held_from_s + hold_s, before, held))
            end_s, before = held_from_s + hold_s, held

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return self.parts[-1].end_s

    def at(self, t_s: float) -> Pair:
        """The velocities in m/s at a time since the start."""
        # `t_s` may be negative: what is measured at the start is about the time before it.
        part = self.parts[max(0, bisect_right(self.parts, t_s, key=attrgetter("begin_s")) - 1)]
        ramp_s = part.held_from_s - part.begin_s
        share = min(max((t_s - part.begin_s) / ramp_s, 0.0), 1.0) if ramp_s > 0 else 1.0
        return Pair(*(a + share * (b - a) for a, b in zip(part.before, part.held, strict=True)))


def there_and_back(top_mps: float, ramp_mps2: float) -> Course:
    """The test drive of a set-up.

    Args:
        top_mps: The greatest speed.
        ramp_mps2: Acceleration of the faster wheel between the parts.
    """
    pieces: list[Piece] = []
    before = Pair(0.0, 0.0)
    for left, right, seconds in _PARTS:
        held = Pair(left * top_mps, right * top_mps)
        change = max(abs(b - a) for a, b in zip(before, held, strict=True))
        pieces.append((held, change / ramp_mps2, seconds))
        before = held
    return Course(top_mps, pieces)


@dataclass(frozen=True)
class Trace:
    """One drive: commanded and measured velocities, left and right, in m/s.

    The measured velocity lags, so the commands are from the moment that it describes.
    """

    times_s: tuple[float, ...]
    commanded: tuple[Pair, ...]
    measured: tuple[Pair, ...]
    lag_s: float
    """Lag of the measured velocity."""

    def rms_mps(self, *wheels: int) -> float:
        """The root mean square of the difference, over these wheels."""
        errors = [
            measured[wheel] - commanded[wheel]
            for commanded, measured in zip(self.commanded, self.measured, strict=True)
            for wheel in wheels
        ]
        return math.sqrt(sum(error * error for error in errors) / len(errors))

    def noise_mps(self, *wheels: int) -> float:
        """How far `rms_mps` may differ from that of the same drive, repeated.

        The standard error of a root mean square, as if the errors were independent after each lag
        of the measured velocity, which is an average over a window.
        """
        seconds = self.times_s[-1] - self.times_s[0]
        independent = max(2.0, seconds / self.lag_s * len(wheels))
        return self.rms_mps(*wheels) / math.sqrt(2 * independent)

    def is_held_up(self, course: Course) -> bool:
        """Whether this computer fell so far behind the course that it drove another one.

        A setpoint answers a sample. If the next sample is read late, the commanded velocity lags
        behind the course until then.
        """
        usual_s = median(b - a for a, b in pairwise(self.times_s))
        return any(
            b - a > _LATE * usual_s
            and any(
                abs(now - then) > _JUMP * course.top_mps
                for now, then in zip(course.at(b), course.at(a), strict=True)
            )
            for a, b in pairwise(self.times_s)
        )

    @property
    def longest_gap_s(self) -> float:
        """The longest time between two samples."""
        return max(b - a for a, b in pairwise(self.times_s))

    def late_mps(self, course: Course) -> float:
        """Root mean square of what the setpoints differed from the course, because they were late.

        As if each had been sent at its sample, been ahead by half of the usual time between two,
        and been active until the next sample.
        """
        gaps = [b - a for a, b in pairwise(self.times_s)]
        ahead_s = median(gaps) / 2
        squares = 0.0
        for begin_s, gap_s in zip(self.times_s, gaps, strict=False):
            sent = course.at(begin_s + ahead_s)
            ends = course.at(begin_s), course.at(begin_s + gap_s)
            # The course is taken as straight from sample to sample.
            for setpoint, first, last in zip(sent, *ends, strict=True):
                a, b = first - setpoint, last - setpoint
                squares += gap_s * (a * a + a * b + b * b) / 3
        return math.sqrt(squares / (2 * sum(gaps)))

    def overshoot(self, course: Course, wheel: int) -> float:
        """The greatest overshoot after a ramp, as a fraction of its step."""
        worst = 0.0
        for part in course.parts:
            step = part.held[wheel] - part.before[wheel]
            held_s = part.end_s - part.held_from_s
            if abs(step) < _SMALLEST_STEP * course.top_mps or held_s < _SHORTEST_HOLD_S:
                continue
            # Divided by the step, overshoot is positive in both directions.
            beyond = [
                (pair[wheel] - part.held[wheel]) / step
                for time, pair in zip(self.times_s, self.measured, strict=True)
                if part.held_from_s <= time < part.end_s
            ]
            worst = max(worst, *means(beyond), 0.0)
        return worst


def means(values: Sequence[float]) -> list[float]:
    """Means over enough samples in a row that noise is not overshoot; at least one mean."""
    count = min(_NOISE_SAMPLES, len(values))
    return [
        sum(values[start : start + count]) / count for start in range(len(values) - count + 1)
    ] or [0.0]


@dataclass(frozen=True)
class Proof:
    """How both drives went.

    Attributes:
        course: What was driven.
        traces: Before and after; None: a fault ended that drive.
        faults: The faults that ended each of the two drives; empty for a drive that reached its
            end.
    """

    course: Course
    traces: tuple[Trace | None, ...]
    faults: tuple[Fault, ...]

    def rms_mps(self, *wheels: int) -> list[float | None]:
        """Tracking error of these wheels, before and after; None: a fault ended that drive."""
        return [trace.rms_mps(*wheels) if trace else None for trace in self.traces]

    def overshoot(self, wheel: int) -> list[float | None]:
        """The same of the greatest overshoot, as a fraction of its step."""
        return [trace.overshoot(self.course, wheel) if trace else None for trace in self.traces]

    @property
    def better(self) -> bool:
        """The new parameters track better beyond the noise, and neither wheel does worse."""
        before, after = self.traces
        # A drive that a fault ended is worse than any other.
        if before is None or after is None:
            return after is not None
        return self._gain_mps(0, 1) > noise_mps(self.traces, 0, 1) and all(
            self._gain_mps(wheel) > -noise_mps(self.traces, wheel) for wheel in (0, 1)
        )

    def _gain_mps(self, *wheels: int) -> float:
        before, after = self.traces
        return before.rms_mps(*wheels) - after.rms_mps(*wheels) if before and after else 0.0

    def verdict(self) -> str:
        """Why the previous values stay, if the new ones are not better."""
        noise_of_both = noise_mps(self.traces, 0, 1)
        noise = f"the noise of {_mmps(noise_of_both)}"
        gain = self._gain_mps(0, 1)
        if abs(gain) <= noise_of_both:
            return f"the previous values track as well, within {noise}; they are left as they are"
        if gain < 0:
            return f"the previous values track better, by more than {noise}; they stay"
        worse = next(w for w in (0, 1) if self._gain_mps(w) < -noise_mps(self.traces, w))
        return (
            f"with the new values the {SIDES[worse]} wheel tracks worse, by more than its noise of "
            f"{_mmps(noise_mps(self.traces, worse))}; the previous ones stay"
        )

    def table(self) -> str:
        """For a terminal: a row for each wheel, and one for both."""
        rows: list[tuple[str, ...]] = [("", "RMS before", "after", "overshoot before", "after")]
        for wheel, name in enumerate(SIDES):
            speeds = map(_mmps, self.rms_mps(wheel))
            rows.append((name, *speeds, *map(_percent, self.overshoot(wheel))))
        rows.append(("both", *map(_mmps, self.rms_mps(0, 1)), "", ""))
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        return "\n".join(
            "  ".join(
                cell.rjust(width) if column else cell.ljust(width)
                for column, (cell, width) in enumerate(zip(row, widths, strict=True))
            ).rstrip()
            for row in rows
        )

    def plot(self, path: Path) -> None:
        """Draw commanded and measured velocity, a panel for each wheel and drive.

        Args:
            path: Its ending says what kind of picture it is, as .png; see `check_picture`.

        Raises:
            ImportError: matplotlib is not installed.
            OSError: The file cannot be written.
            ValueError: There is no such kind of picture.
        """
        draw(path, tuple(zip(("before", "after"), self.traces, strict=True)))


def noise_mps(traces: Iterable[Trace | None], *wheels: int) -> float:
    """What a difference between these drives may be by chance; twice its standard error."""
    return 2 * math.hypot(*(trace.noise_mps(*wheels) for trace in traces if trace))


def draw(path: Path, drives: Sequence[tuple[str, Trace | None]]) -> None:
    """Draw commanded and measured velocity, a panel for each wheel and drive.

    Args:
        path: Its ending says what kind of picture it is, as .png; see `check_picture`.
        drives: Each with its title; None: a fault ended it.

    Raises:
        ImportError: matplotlib is not installed.
        OSError: The file cannot be written.
        ValueError: There is no such kind of picture.
    """
    from matplotlib.figure import Figure  # not pyplot, which needs a display

    figure = Figure(figsize=(11, 5), layout="constrained")
    panels = figure.subplots(2, len(drives), sharex=True, sharey=True, squeeze=False)
    for column, (title, trace) in enumerate(drives):
        panels[0][column].set_title(title if trace else f"{title}: ended by a fault")
        for wheel, name in enumerate(SIDES):
            axes = panels[wheel][column]
            axes.grid(alpha=0.3)
            if trace:
                # The command is thick and lies below, so that both lines can be seen.
                lines = (("commanded", trace.commanded, 4.0), ("measured", trace.measured, 1.0))
                for label, pairs, width in lines:
                    speeds = [pair[wheel] for pair in pairs]
                    axes.plot(trace.times_s, speeds, label=label, linewidth=width, alpha=0.7)
                axes.legend(loc="lower right", fontsize="small")
            if column == 0:
                axes.set_ylabel(f"{name} [m/s]")
    for axes in panels[1]:
        axes.set_xlabel("time [s]")
    save_figure(figure, path, dpi=110)


def check_picture(path: Path) -> None:
    """Find out whether a picture can be drawn to this file, by its ending.

    Raises:
        ImportError: matplotlib is not installed.
        InvalidArgument: There is no such kind of picture.
    """
    from matplotlib.figure import Figure

    try:
        # Only drawing shows it: some kinds need other programs.
        Figure().savefig(BytesIO(), format=path.suffix[1:] or "none")
    except (ValueError, OSError, RuntimeError, ImportError) as error:
        raise InvalidArgument(
            f"{path}: no picture can be drawn to a file that ends in {path.suffix or 'nothing'}: "
            "name it .png, .svg or .pdf"
        ) from error


def prove(
    robot: Robot,
    before: Mapping[str, float],
    after: Mapping[str, float],
    left: ShowTimeLeft = driving.show_nothing,
) -> Proof:
    """Drive the course with both sets of parameters.

    Takes half a minute. At the end, whatever happens, the robot stands and has the values of
    `before` again.

    Args:
        robot: Raised, or with a metre of floor ahead of it.
        before: Values of the parameters that `after` changes, by name; the same names.
        after: The values to try.
        left: Called with about how long the wheels still turn [s].

    Raises:
        CommissioningFailed: An e-stop or a fault was latched before; the board was reset, or
            the link was lost for a while.
        DeviceRefused: An e-stop was latched during the drive, or a value is refused.
        LinkLost: The robot is out of reach; a reset brings back what was saved.
    """
    driving.require_ready(robot)
    # One course for both drives: its speed follows from the new feed-forward.
    course = _course(robot, {**before, **after})
    traces, faults = drive_with_each(robot, (before, after), course, left, _ATTEMPTS)
    return Proof(course, traces, faults)


def drive_with_each(
    robot: Robot,
    sets: Sequence[Mapping[str, float]],
    course: Course,
    left: ShowTimeLeft = driving.show_nothing,
    attempts: int = 1,
) -> tuple[tuple[Trace | None, ...], tuple[Fault, ...]]:
    """Drive a course with each set of parameters; the traces, and the faults that ended a drive.

    Afterwards the robot has the first set again. `attempts` as `drive_with`, otherwise as `prove`.
    """
    found = []
    with driving.one_session(robot):
        try:
            for driven, values in enumerate(sets):
                left((len(sets) - driven) * course.seconds)
                found.append(drive_with(robot, values, course, attempts))
        finally:
            # The stop first: while the robot drives, some of the previous values would be refused.
            robot.stop()
            _set(robot, sets[0])
            left(0.0)
    traces, faults = zip(*found, strict=True)
    return traces, faults


def _course(robot: Robot, values: Mapping[str, float]) -> Course:
    """As fast as the robot can, within its limits and a metre."""
    static, feedforward, of_acceleration = (
        values[name] if name in values else robot.parameters[name]
        for name in ("static_feedforward", "velocity_feedforward", "acceleration_feedforward")
    )
    most_duty = robot.parameters["max_duty"]
    # Less than the robot's limits: the loop needs the rest to make up for errors.
    ramp_mps2 = min(RAMP_MPS2, 0.7 * robot.parameters["max_acceleration_mps2"])
    if of_acceleration > 0:
        ramp_mps2 = min(ramp_mps2, _DUTY_OF_RAMP * most_duty / of_acceleration)
    # Ahead it rolls top^2 / ramp + top * 1 s: see _PARTS.
    within_m = (math.sqrt(1 + 4 * _LONGEST_WAY_M / ramp_mps2) - 1) * ramp_mps2 / 2
    top_mps = min(TOP_MPS, within_m, 0.8 * robot.parameters["max_velocity_mps"])
    if feedforward > 0:
        reached = (_DUTY_AT_TOP * most_duty - static) / feedforward
        # With feed-forwards that are far off, the robot still has to move for a comparison.
        top_mps = min(top_mps, max(reached, 0.2 * top_mps))
    return there_and_back(top_mps, ramp_mps2)


def drive_with(
    robot: Robot, values: Mapping[str, float], course: Course, attempts: int = 1
) -> tuple[Trace | None, Fault]:
    """Drive a course with these parameters.

    A fault that ends the drive is cleared; there is no trace then.

    Args:
        robot: Ready to drive.
        values: The parameters, by name.
        course: What to drive.
        attempts: Most drives before one succeeds without this computer falling behind. More than
            one only for a course that ends where it began.

    Raises:
        CommissioningFailed: A wheel got too far, or setpoints come too late.
        DeviceRefused, LinkLost: As `prove`.
    """
    # The setpoint of the drive before may still be active, and some parameters change only while
    # the robot stands.
    robot.stop()
    _set(robot, values)
    for _ in range(attempts):
        trace, faults = driving.uninterrupted(partial(_drive, robot, course))
        if trace is None or not trace.is_held_up(course):
            break
    if faults:
        driving.come_to_rest(robot)
        robot.clear_fault()
        driving.arm(robot)
    return trace, faults


def _drive(robot: Robot, course: Course) -> tuple[Trace | None, Fault] | None:
    """A trace, or the fault that ended the drive; None if a setpoint expired."""
    resting = driving.come_to_rest(robot)
    # A sample says where the wheels were when it was taken. The setpoint that answers it arrives a
    # round trip later, and is active until the next one: its middle has to be on the course.
    round_trip_us = robot.statistics.round_trip_p50_us
    ahead_s = 0.0 if math.isnan(round_trip_us) else round_trip_us / 1e6
    ahead_s += resting.seconds / (len(resting.samples) - 1) / 2
    record = Record(driving.next_sample(robot))
    m_per_tick = 2 * math.pi * robot.parameters["wheel_radius"]
    m_per_tick /= robot.parameters["counts_per_revolution"]
    while record.seconds < course.seconds:
        # Along the course by the robot's clock, so that a late sample does not stretch it.
        left, right = course.at(record.seconds + ahead_s)
        try:
            robot.set_wheel_velocity(left, right, driving.life_s(robot))
        except DeviceRefused as error:
            if error.faults:
                return None, error.faults
            raise
        record.add(driving.next_sample(robot))
        # A fault may show in a sample before a setpoint is refused because of it.
        if record.faults:
            return None, record.faults
        if (way_m := max(map(abs, record.ticks)) * m_per_tick) > course.longest_way_m:
            robot.stop()
            raise CommissioningFailed(
                f"a wheel is {way_m:.2f} m from where it began, more than this drive needs; "
                "stopped: choose other gains, or drive slower"
            )
    if record.lapsed:
        return None
    lag_s = _MEASUREMENT_LAG * robot.parameters["velocity_window_us"] / 1e6
    times_s = record.times_s()
    trace = Trace(
        tuple(times_s),
        tuple(course.at(time - lag_s) for time in times_s),
        tuple(Pair(sample.left_mps, sample.right_mps) for sample in record.samples),
        lag_s,
    )
    return trace, Fault(0)


def _set(robot: Robot, values: Mapping[str, float]) -> None:
    for name, value in values.items():
        driving.set_at_rest(robot, name, value)


def _mmps(value: float | None) -> str:
    return "fault" if value is None else f"{value * 1e3:.1f} mm/s"


def _percent(value: float | None) -> str:
    return "fault" if value is None else f"{value:.0%}"
