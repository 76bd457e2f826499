"""Driving while measuring: setpoints renewed with each sample, pulses, and what was sampled."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median
from typing import NamedTuple, TypeVar

from wheelwire_protocol.codes import Fault, RefusalCode, SupervisorState

from ...errors import CommissioningFailed, DeviceRefused, LinkLost, WheelwireError
from ...parameters import definition_of
from ...robot.robot import Robot
from ...samples import WheelSample

TTL_S = 0.3
"""Time to live of each setpoint: a program that hangs or is killed drives no longer."""
LAPSE_S = 0.25
"""Gap between two samples in which the setpoint sent at the first one may have run out."""
ATTEMPTS = 8
"""Attempts at a motion during which a setpoint ran out."""
PATIENCE_S = 5.0
"""A busy computer may show no sample for so long; the wheels have long been stopped then."""
STANDSTILL_S = 0.15
"""A wheel without a tick for this long stands."""
LONGEST_ROLL_S = 5.0
RESTING_TICKS = 1
"""An encoder that rests on an edge may toggle by this much."""

_LONGEST_ARMING_S = 3.0
"""On a bad line."""
_REOPENED_S = 3.0
"""For a board to start, and a new session with it to open."""

COUNTED_TICKS = 4
"""A whole period of A and B: an encoder with one dead channel never gets there."""
TOGGLES = 3
"""Changes of a count that are more than an encoder at rest on an edge."""

_RISE_S = 0.08
_HARDER_S = 0.15
_LOWEST_DUTY = 0.1
_RISE = 1.25
_HIGHEST_DUTY = 0.6
"""Highest duty of a wheel whose counter does nothing: nothing tells how far it turns."""
_HARDEST_DUTY = 0.98
"""A duty below the highest `reversal_duty`, so that at that value no pulse trips REVERSED."""
_SHOW_S = 0.25
_REST_S = 0.1
_OWN_FAULTS = (
    Fault.LEFT_NOT_COUNTING | Fault.RIGHT_NOT_COUNTING | Fault.LEFT_REVERSED | Fault.RIGHT_REVERSED
)
"""What a wrong wiring trips; the wheels have been stopped."""

_BUNCH_TICKS = 5
"""Fewer than that could be an uneven encoder."""

SIDES = ("left", "right")

Motion = TypeVar("Motion")

ShowTimeLeft = Callable[[float], None]
"""Called with about how long the wheels still turn [s], time and again; with 0 once they stand."""


def show_nothing(_left_s: float) -> None:
    """Ignores how long the wheels still turn."""


class Pair(NamedTuple):
    """A value for each wheel."""

    left: float
    right: float


class BoardReset(CommissioningFailed):
    """The board was reset while a wheel was driven."""

    def __init__(self) -> None:
        super().__init__(
            "the board was reset while the wheels turned: does the supply sag? Check the battery "
            "and its leads, then begin again"
        )


class Record:
    """The samples of a motion, counted from its first one: all of one boot.

    Attributes:
        samples: All of them.
    """

    def __init__(self, first: WheelSample) -> None:
        self.samples = [first]

    def add(self, sample: WheelSample) -> None:
        """Raises `BoardReset` if the board was reset."""
        if sample.boot_id != self.samples[0].boot_id:
            raise BoardReset
        self.samples.append(sample)

    @property
    def lapsed(self) -> bool:
        """A setpoint came too late to continue the one before, so the wheels were stopped."""
        # TIMED_OUT before the first DRIVING is what an earlier motion has left.
        states = [sample.state for sample in self.samples]
        first = states.index(SupervisorState.DRIVING) if SupervisorState.DRIVING in states else 0
        if SupervisorState.TIMED_OUT in states[first:]:
            return True
        # In a gap between two samples it may have run out and driven again, unseen.
        return any(b.t_us - a.t_us > 1e6 * LAPSE_S for a, b in pairwise(self.samples))

    @property
    def seconds(self) -> float:
        """Time from the first sample to the last one."""
        return (self.samples[-1].t_us - self.samples[0].t_us) / 1e6

    @property
    def ticks(self) -> tuple[int, int]:
        """Travelled in total, in ticks."""
        travel = self.samples[-1].since(self.samples[0])
        return travel.left, travel.right

    @property
    def toggles(self) -> tuple[int, int]:
        """Number of samples in which each counter had changed."""
        steps = [b.since(a) for a, b in pairwise(self.samples)]
        return sum(s.left != 0 for s in steps), sum(s.right != 0 for s in steps)

    @property
    def faults(self) -> Fault:
        """That ended the motion, if any did."""
        last = self.samples[-1]
        return last.faults if last.state is SupervisorState.FAULT else Fault(0)

    def times_s(self) -> list[float]:
        """The time of each sample, from the first one."""
        begin_us = self.samples[0].t_us
        return [(sample.t_us - begin_us) / 1e6 for sample in self.samples]

    def travel(self, wheel: int) -> list[int]:
        """Ticks of a wheel at each sample, from the first one."""
        travels = [sample.since(self.samples[0]) for sample in self.samples]
        return [(travel.left, travel.right)[wheel] for travel in travels]


def hold_duty(robot: Robot, duty: Pair, seconds: float) -> Record:
    """Drive at a duty for some time on the robot's clock."""
    return follow_duty(robot, lambda _: duty, lambda record: record.seconds >= seconds)


def meaning_of(faults: Fault) -> str:
    """What each of these faults means, in sentences."""
    return " ".join(fault.doc for fault in Fault if fault in faults)


def duty_of(sample: WheelSample, wheel: int) -> float:
    """The duty of one wheel."""
    return (sample.left_duty, sample.right_duty)[wheel]


def follow_duty(
    robot: Robot, duty: Callable[[Record], Pair], *until: Callable[[Record], bool]
) -> Record:
    """Drive at the duty that `duty` says at each sample, until one of the conditions holds.

    Raises:
        DeviceRefused: An e-stop or a fault is latched.
        LinkLost: The robot is out of reach.
        CommissioningFailed: The board was reset.
    """
    record = Record(next_sample(robot))
    while True:
        robot.set_duty(*duty(record), life_s(robot))
        record.add(next_sample(robot))
        if any(condition(record) for condition in until):
            return record


def arm(robot: Robot) -> None:
    """Ask for standstill until the robot has obeyed: after a clear or a start nothing else drives.

    Raises:
        DeviceRefused: An e-stop or a fault is latched.
        CommissioningFailed: No setpoint reaches the robot.
    """
    begin = sample = fresh(robot)
    while sample.state is not SupervisorState.DRIVING:
        if sample.since(begin).dt_s > _LONGEST_ARMING_S:
            raise CommissioningFailed("no setpoint reaches the robot: check the cable")
        # Again and again: a setpoint is not acknowledged, and may be lost.
        robot.set_wheel_velocity(0.0, 0.0, life_s(robot))
        sample = next_sample(robot)
    # Some parameters change only while nothing is obeyed.
    robot.stop()


def life_s(robot: Robot) -> float:
    """For how long a setpoint lives."""
    return min(TTL_S, robot.ttl_max_s or TTL_S)


def next_sample(robot: Robot) -> WheelSample:
    """The next one, however late it is.

    Raises:
        LinkLost: The robot is out of reach.
        RequestTimeout: It sends none.
    """
    return robot.read(PATIENCE_S)


def fresh(robot: Robot) -> WheelSample:
    """A sample from after this call: the next one may be older than the last request."""
    next_sample(robot)
    return next_sample(robot)


def uninterrupted(motion: Callable[[], Motion | None]) -> Motion:
    """Repeat a motion that returned None because a setpoint expired during it.

    Raises:
        CommissioningFailed: Setpoints expire again and again.
    """
    for _ in range(ATTEMPTS):
        result = motion()
        if result is not None:
            return result
    raise CommissioningFailed(
        "setpoints keep reaching the robot too late: this computer or the line is too busy; "
        "end other programs, then begin again"
    )


def come_to_rest(robot: Robot) -> Record:
    """Stop, and wait until no wheel turns; the samples until then.

    Raises:
        CommissioningFailed: A wheel turns though it is not driven.
    """
    robot.stop()
    record = Record(next_sample(robot))
    anchor, last_move_s = record.ticks, 0.0
    while record.seconds - last_move_s < STANDSTILL_S:
        record.add(next_sample(robot))
        # Compared with where it last moved: from one sample to the next, a wheel that creeps may
        # move no further than an encoder at rest toggles.
        moved = max(abs(now - then) for now, then in zip(record.ticks, anchor, strict=True))
        if moved > RESTING_TICKS:
            anchor, last_move_s = record.ticks, record.seconds
        if record.seconds > LONGEST_ROLL_S:
            raise CommissioningFailed("a wheel turns although it is not driven: hold it still")
    return record


@contextmanager
def one_session(robot: Robot) -> Iterator[None]:
    """Refuse what was measured partly after a reset or with the link lost for a while.

    Raises:
        BoardReset: The board was reset; or else
        CommissioningFailed: There is a new session: parameters that were not saved are lost, too.
    """
    before = robot.statistics
    try:
        yield
    except (LinkLost, DeviceRefused) as error:
        # A reset shows as a lost link, or as a refusal for want of the trial of parameters that it
        # has ended. Which of them it was, only the next session tells.
        with suppress(WheelwireError):
            robot.read(_REOPENED_S)
        if robot.statistics.device_resets != before.device_resets:
            raise BoardReset from error
        raise
    after = robot.statistics
    if after.device_resets != before.device_resets:
        raise BoardReset
    if after.sessions != before.sessions:
        raise CommissioningFailed(
            "the link was lost for a while: check the cable, then begin again"
        )


def set_at_rest(robot: Robot, name: str, value: float) -> None:
    """Set a parameter, just after a motion, too: as soon as the robot itself takes it for at rest.

    Raises:
        DeviceRefused: The value is refused for another reason, or a wheel goes on turning.
    """
    begin: WheelSample | None = None
    is_late = False
    while True:
        try:
            robot.parameters.set(name, value)
        except DeviceRefused as error:
            if error.code != RefusalCode.NOT_STOPPED or is_late:
                raise
        else:
            return
        begin = begin or next_sample(robot)
        is_late = next_sample(robot).since(begin).dt_s > LONGEST_ROLL_S


@contextmanager
def not_watching(robot: Robot, name: str) -> Iterator[None]:
    """Set a threshold to its maximum for a while. Only in a trial of parameters.

    If the block is left by an exception, the end of the trial restores the threshold.
    """
    previous = robot.parameters[name]
    set_at_rest(robot, name, definition_of(name).maximum)
    yield
    set_at_rest(robot, name, previous)


def require_ready(robot: Robot) -> None:
    """Refuse what would be refused later, before anything moves.

    Raises:
        CommissioningFailed: An e-stop or a fault is latched.
    """
    sample = fresh(robot)
    if sample.state is SupervisorState.ESTOPPED:
        raise CommissioningFailed("the e-stop is latched: release it, then `wheelwire clear ROBOT`")
    if sample.state is SupervisorState.FAULT:
        raise CommissioningFailed(
            f"a fault is latched: {meaning_of(sample.faults)} Then `wheelwire clear ROBOT`"
        )


@dataclass(frozen=True)
class Pulsed:
    """What the pulses of one bridge did.

    Attributes:
        duty: The duty at which a counter began to count; the highest one if none did.
        ticks: Ticks of each counter.
        toggles: In how many samples each counter had changed.
    """

    duty: float
    ticks: tuple[int, int]
    toggles: tuple[int, int]

    def counted(self, counter: int) -> bool:
        """Whether it went on in one direction."""
        return abs(self.ticks[counter]) >= COUNTED_TICKS

    def toggled(self, counter: int) -> bool:
        """Whether its count oscillated."""
        return abs(self.ticks[counter]) <= 1 and self.toggles[counter] >= TOGGLES

    @property
    def was_noticed(self) -> bool:
        """Whether a counter did anything."""
        return any(self.counted(side) or self.toggled(side) for side in (0, 1))


def pulse(robot: Robot, side: int) -> Pulsed:
    """Pulse one bridge forward with rising duty until a counter counts, then once a little longer.

    With any motor a wheel turns less than 1.5 turns in total. Each pulse is a single setpoint
    that ends on the robot's own clock.

    Raises:
        CommissioningFailed: The board was reset, or an e-stop or another fault was latched.
    """
    return _rise(robot, side, _RISE_S, _LOWEST_DUTY, _HIGHEST_DUTY)


def pulse_harder(robot: Robot, side: int) -> Pulsed:
    """Continue where `pulse` ended: nothing turned, or the wheel and its direction are known."""
    return _rise(robot, side, _HARDER_S, _HIGHEST_DUTY * _RISE, _HARDEST_DUTY)


def _rise(robot: Robot, side: int, seconds: float, duty: float, unnoticed: float) -> Pulsed:
    """Raise the duty until a counter counts; as long as none does anything, up to `unnoticed`."""
    while True:
        pulsed = _pulse(robot, side, duty, seconds)
        if pulsed.was_noticed:
            # The longer pulse has more ticks. If it shows nothing, the first one is what there is.
            shown = show(robot, side, pulsed)
            return shown if shown.was_noticed else pulsed
        # One tick or two: there is an encoder, and its wheel hardly moves yet.
        highest = _HARDEST_DUTY if any(pulsed.toggles) else unnoticed
        if duty >= highest:
            return pulsed
        duty = min(duty * _RISE, highest)


def show(robot: Robot, side: int, pulsed: Pulsed) -> Pulsed:
    """Pulse one bridge again, long enough for a person to see which way the wheel turns."""
    duty, seconds = min(pulsed.duty * _RISE, _HARDEST_DUTY), _SHOW_S
    if not pulsed.was_noticed:  # how fast the wheel turns, if it does, is not known
        duty, seconds = pulsed.duty, _RISE_S
    return replace(_pulse(robot, side, duty, seconds), duty=pulsed.duty)


def _pulse(robot: Robot, side: int, duty: float, seconds: float) -> Pulsed:
    driven = run(robot, Pair(duty, 0.0) if side == 0 else Pair(0.0, duty), seconds)
    return Pulsed(duty, driven.ticks, driven.toggles)


def run(robot: Robot, duties: Pair, seconds: float) -> Record:
    """Drive both bridges for this long, stop, and wait for standstill.

    The robot's own clock ends a short drive. Faults that a wrong wiring trips
    are cleared; they are in the result.

    Raises:
        CommissioningFailed: The board was reset, or an e-stop or another fault was latched.
    """
    record = Record(fresh(robot))
    with one_session(robot):
        _drive(robot, duties, seconds, record)
    sample = record.samples[-1]
    if sample.state is SupervisorState.ESTOPPED:
        raise CommissioningFailed("the e-stop was pressed; begin again when the robot may move")
    if sample.state is SupervisorState.FAULT:
        if sample.faults & ~_OWN_FAULTS:
            raise CommissioningFailed(f"a fault stopped the robot: {meaning_of(sample.faults)}")
        robot.clear_fault()
        arm(robot)
    return record


def _drive(robot: Robot, duties: Pair, seconds: float, record: Record) -> None:
    set_until_s = 0.0
    while (now_s := record.seconds) < seconds:
        # Renewed at half of its life, so that a late sample does not interrupt the drive.
        if set_until_s < seconds and set_until_s - now_s < life_s(robot) / 2:
            ttl = min(life_s(robot), seconds - now_s)
            try:
                robot.set_duty(*duties, ttl=ttl)
            except DeviceRefused as error:
                if error.code != RefusalCode.FAULT:  # the next sample has a fault
                    raise
            set_until_s = now_s + ttl
        record.add(next_sample(robot))
        if record.samples[-1].state is SupervisorState.FAULT:
            break
    robot.stop()
    moved_s = record.seconds
    while record.seconds - moved_s < _REST_S:
        record.add(next_sample(robot))
        if record.samples[-1].since(record.samples[-2])[:2] != (0, 0):
            moved_s = record.seconds
        if record.seconds > seconds + LONGEST_ROLL_S:
            break  # a counter that toggles at rest


def has_gap(samples: Sequence[WheelSample], side: int) -> bool:
    """Whether counts stop for a while, and what was missed comes at once.

    Args:
        samples: Samples of a wheel that turns steadily, in either direction.
        side: Side of the counter.
    """
    travels = [later.since(earlier) for earlier, later in pairwise(samples)]
    steps = [(travel[side], travel.dt_s) for travel in travels]
    travel = sum(ticks for ticks, _ in steps)
    if not travel:
        return False
    forward = [(math.copysign(1, travel) * ticks, seconds) for ticks, seconds in steps]
    rate = abs(travel) / sum(seconds for _, seconds in steps)
    typical = median(ticks for ticks, _ in forward)
    still_s, still_samples = 0.0, 0
    for ticks, seconds in forward:
        if ticks == 0:
            still_s, still_samples = still_s + seconds, still_samples + 1
            continue
        # A wheel that hesitated does not make up for what it missed.
        missed = rate * still_s
        if still_samples > 1 and missed >= _BUNCH_TICKS and ticks > typical + missed / 2:
            return True
        still_s, still_samples = 0.0, 0
    return False
