"""Driving while measuring: setpoints that are renewed with each sample, and what was sampled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import NamedTuple, TypeVar

from wheelwire_protocol.codes import SupervisorState

from ..drivers.base import BaseDriver
from ..errors import CommissioningFailed, DeviceRefused, LinkLost, WheelwireError
from ..parameters import definition_of
from ..samples import WheelSample

TTL_S = 0.3
"""How long each setpoint lives: a program that hangs or is killed drives no longer than this."""
LAPSE_S = 0.25
"""Between two samples: a setpoint that was sent at the first may have run out."""
ATTEMPTS = 4
"""How often to try a motion during which a setpoint ran out."""
STANDSTILL_S = 0.15
"""Without a tick."""
LONGEST_ROLL_S = 5.0
RESTING_TICKS = 1
"""An encoder that rests on an edge may toggle by this much."""

_LONGEST_ARMING_S = 3.0
"""On a bad line."""
_REOPENED_S = 3.0
"""How long a board may take to start and to open a new session."""

SIDES = ("left", "right")

Motion = TypeVar("Motion")

Left = Callable[[float], None]
"""Called with about how long the wheels still turn [s], time and again; with 0 once they stand."""


def untold(_left_s: float) -> None:
    """Nobody wants to know how long the wheels still turn."""


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
    """The samples of a motion, counted from its first one.

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
        return any(
            later.since(earlier).dt_s > LAPSE_S
            for earlier, later in zip(self.samples, self.samples[1:], strict=False)
        )

    @property
    def seconds(self) -> float:
        """From the first sample to the last one."""
        return self.samples[-1].since(self.samples[0]).dt_s

    @property
    def ticks(self) -> tuple[int, int]:
        """Travelled in total, in ticks."""
        travel = self.samples[-1].since(self.samples[0])
        return travel.left, travel.right

    def times_s(self) -> list[float]:
        """The time of each sample, counted from the first one."""
        return [sample.since(self.samples[0]).dt_s for sample in self.samples]

    def travel(self, wheel: int) -> list[int]:
        """Ticks of a wheel at each sample, from the first one."""
        travels = [sample.since(self.samples[0]) for sample in self.samples]
        return [(travel.left, travel.right)[wheel] for travel in travels]


def hold_duty(
    robot: BaseDriver,
    duty: Pair,
    seconds: float,
    until: Callable[[Record], bool] = lambda _: False,
) -> Record:
    """Drive at a duty for some time on the robot's clock, or until something is reached."""
    return follow_duty(robot, lambda _: duty, lambda record: record.seconds >= seconds, until)


def follow_duty(
    robot: BaseDriver, duty: Callable[[Record], Pair], *until: Callable[[Record], bool]
) -> Record:
    """Drive at the duty that `duty` says at each sample, until one of the conditions holds.

    Raises:
        DeviceRefused: An e-stop or a fault is latched.
        LinkLost: The robot is out of reach.
        CommissioningFailed: The board was reset.
    """
    record = Record(robot.read())
    while True:
        robot.set_duty(*duty(record), life_s(robot))
        record.add(robot.read())
        if any(condition(record) for condition in until):
            return record


def arm(robot: BaseDriver) -> None:
    """After a clear, which restarts nothing: ask for standstill until the robot has obeyed.

    Raises:
        DeviceRefused: An e-stop or a fault is latched.
        CommissioningFailed: No setpoint reaches the robot.
    """
    begin = fresh(robot)
    sample = begin
    while sample.state is not SupervisorState.DRIVING:
        if sample.since(begin).dt_s > _LONGEST_ARMING_S:
            raise CommissioningFailed("no setpoint reaches the robot: check the cable")
        # Again and again: a setpoint is not acknowledged, and may be lost.
        robot.set_wheel_velocity(0.0, 0.0, life_s(robot))
        sample = robot.read()
    # Some parameters change only while nothing is obeyed.
    robot.stop()


def life_s(robot: BaseDriver) -> float:
    """For how long a setpoint lives."""
    return min(TTL_S, robot.ttl_max_s or TTL_S)


def fresh(robot: BaseDriver) -> WheelSample:
    """A sample from after this call: the next one may be older than the last request."""
    robot.read()
    return robot.read()


def uninterrupted(motion: Callable[[], Motion | None]) -> Motion:
    """Repeat a motion that is None because a setpoint ran out meanwhile.

    Raises:
        CommissioningFailed: They run out again and again.
    """
    for _ in range(ATTEMPTS):
        result = motion()
        if result is not None:
            return result
    raise CommissioningFailed(
        "setpoints reach the robot too late again and again: this computer or the line is too "
        "busy; end other programs, then begin again"
    )


def come_to_rest(robot: BaseDriver) -> Record:
    """Stop, and wait until no wheel turns; the samples until then.

    Raises:
        CommissioningFailed: A wheel turns though it is not driven.
    """
    robot.stop()
    record = Record(robot.read())
    anchor, last_move_s = record.ticks, 0.0
    while record.seconds - last_move_s < STANDSTILL_S:
        record.add(robot.read())
        # Compared with where it last moved: from one sample to the next, a wheel that creeps may
        # move no further than an encoder at rest toggles.
        moved = max(abs(now - then) for now, then in zip(record.ticks, anchor, strict=True))
        if moved > RESTING_TICKS:
            anchor, last_move_s = record.ticks, record.seconds
        if record.seconds > LONGEST_ROLL_S:
            raise CommissioningFailed("a wheel turns though it is not driven: hold it still")
    return record


@contextmanager
def one_session(robot: BaseDriver) -> Iterator[None]:
    """Refuse what was measured partly after a reset or with the link lost for a while.

    Raises:
        BoardReset: The board was reset meanwhile; or else
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


@contextmanager
def not_watching(robot: BaseDriver, name: str) -> Iterator[None]:
    """Set a threshold to its maximum for a while. Only in a trial of parameters.

    If the block is left by an exception, the end of the trial restores the threshold.
    """
    previous = robot.parameters[name]
    robot.parameters.set(name, definition_of(name).maximum)
    yield
    robot.parameters.set(name, previous)


def require_ready(robot: BaseDriver) -> None:
    """Refuse what would be refused later, before anything moves.

    Raises:
        CommissioningFailed: An e-stop or a fault is latched.
    """
    sample = fresh(robot)
    if sample.state is SupervisorState.ESTOPPED:
        raise CommissioningFailed("the e-stop is latched: release it, then `wheelwire clear ROBOT`")
    if sample.state is SupervisorState.FAULT:
        reasons = " ".join(fault.doc for fault in type(sample.faults) if fault in sample.faults)
        raise CommissioningFailed(f"a fault is latched: {reasons} Then `wheelwire clear ROBOT`")
