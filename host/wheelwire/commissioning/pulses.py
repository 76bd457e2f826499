"""Short drives of raised wheels, and what the two counters did meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from wheelwire_protocol.codes import Fault, RefusalCode, SupervisorState

from ..drivers.base import BaseDriver
from ..errors import CommissioningFailed, DeviceRefused
from ..samples import WheelSample, tick_difference
from .motion import BoardReset, arm, fresh, life_s, one_session

COUNTED_TICKS = 4
"""A whole period of A and B: an encoder with one dead channel never gets there."""
TOGGLES = 3
"""Changes of a count that are more than an encoder at rest on an edge."""

_RISE_S = 0.08
_HARDER_S = 0.15
_LOWEST_DUTY = 0.1
_RISE = 1.25
_HIGHEST_DUTY = 0.6
"""The highest duty while a wheel does not count: it may turn, and nothing shows how far."""
_HARDEST_DUTY = 0.98
"""Less than the highest `reversal_duty`, so that then no pulse trips REVERSED."""
_SHOW_S = 0.25
_REST_S = 0.1
_LONGEST_REST_S = 5.0
NO_FAULT = Fault(0)
_OWN_FAULTS = (
    Fault.LEFT_NOT_COUNTING | Fault.RIGHT_NOT_COUNTING | Fault.LEFT_REVERSED | Fault.RIGHT_REVERSED
)
"""What a wrong wiring trips; the wheels have been stopped."""


@dataclass(frozen=True)
class Run:
    """The samples of a drive, from standstill to standstill.

    Attributes:
        samples: The first one is from before the drive.
    """

    samples: tuple[WheelSample, ...]

    @property
    def ticks(self) -> tuple[int, int]:
        """How far each counter moved, from the first sample to the last one."""
        travel = self.samples[-1].since(self.samples[0])
        return travel.left, travel.right

    @property
    def toggles(self) -> tuple[int, int]:
        """In how many samples each counter had changed."""
        steps = [b.since(a) for a, b in pairwise(self.samples)]
        return sum(s.left != 0 for s in steps), sum(s.right != 0 for s in steps)

    @property
    def faults(self) -> Fault:
        """The faults that ended the drive, if any did."""
        last = self.samples[-1]
        return last.faults if last.state is SupervisorState.FAULT else NO_FAULT

    @property
    def lowest_v(self) -> float | None:
        """The supply's lowest voltage; None if the board does not measure it."""
        measured = [s.battery_v for s in self.samples if s.battery_v is not None]
        return min(measured, default=None)


@dataclass(frozen=True)
class Pulsed:
    """What the pulses of one bridge did.

    Attributes:
        duty: At which a counter began to count; the highest one if none did.
        ticks: Of each counter.
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


def pulse(robot: BaseDriver, side: int) -> Pulsed:
    """Pulse one bridge forward with rising duty until a counter counts, then once a little longer.

    With any motor a wheel turns less than 1.5 turns in total. Each pulse is a single setpoint
    that ends on the robot's own clock.

    Raises:
        CommissioningFailed: The board was reset, or an e-stop or another fault was latched.
    """
    return _rise(robot, side, _RISE_S, _LOWEST_DUTY, _HIGHEST_DUTY)


def pulse_harder(robot: BaseDriver, side: int) -> Pulsed:
    """Go on where `pulse` ended: nothing turned, or it is known which wheel does, and which way."""
    return _rise(robot, side, _HARDER_S, _HIGHEST_DUTY * _RISE, _HARDEST_DUTY)


def _rise(robot: BaseDriver, side: int, seconds: float, duty: float, unnoticed: float) -> Pulsed:
    """Raise the duty until a counter counts; as long as none does anything, up to `unnoticed`."""
    while True:
        pulsed = _pulsed(duty, run(robot, _duties(side, duty), seconds))
        if pulsed.was_noticed:
            # The longer pulse has more ticks. If it shows nothing, the first one is what there is.
            shown = show(robot, side, pulsed)
            return shown if shown.was_noticed else pulsed
        # One tick or two: there is an encoder, and its wheel hardly moves yet.
        highest = _HARDEST_DUTY if any(pulsed.toggles) else unnoticed
        if duty >= highest:
            return pulsed
        duty = min(duty * _RISE, highest)


def show(robot: BaseDriver, side: int, pulsed: Pulsed) -> Pulsed:
    """Pulse one bridge once more, long enough for a person to see which way the wheel turns."""
    if not pulsed.was_noticed:  # how fast the wheel turns, if it does, is not known
        return _pulsed(pulsed.duty, run(robot, _duties(side, pulsed.duty), _RISE_S))
    duty = min(pulsed.duty * _RISE, _HARDEST_DUTY)
    return _pulsed(pulsed.duty, run(robot, _duties(side, duty), _SHOW_S))


def run(robot: BaseDriver, duties: tuple[float, float], seconds: float) -> Run:
    """Drive both bridges for this long, stop, and wait for standstill.

    The robot's own clock ends a short drive. Faults that a wrong wiring trips
    are cleared; they are in the result.

    Raises:
        CommissioningFailed: The board was reset, or an e-stop or another fault was latched.
    """
    samples = [fresh(robot)]
    with one_session(robot):
        _drive(robot, duties, seconds, samples)
    _clear(robot, samples[-1])
    return Run(tuple(samples))


def _drive(
    robot: BaseDriver, duties: tuple[float, float], seconds: float, samples: list[WheelSample]
) -> None:
    set_until_s = 0.0
    while (now_s := _seconds(samples)) < seconds:
        # Renewed at half of its life, so that a late sample does not interrupt the drive.
        if set_until_s < seconds and set_until_s - now_s < life_s(robot) / 2:
            ttl = min(life_s(robot), seconds - now_s)
            _set_duty(robot, duties, ttl)
            set_until_s = now_s + ttl
        samples.append(_next(robot, samples))
        if samples[-1].state is SupervisorState.FAULT:
            break
    robot.stop()
    moved = _seconds(samples)
    while _seconds(samples) - moved < _REST_S:
        samples.append(_next(robot, samples))
        if samples[-1].since(samples[-2])[:2] != (0, 0):
            moved = _seconds(samples)
        if _seconds(samples) > seconds + _LONGEST_REST_S:
            break  # a counter that toggles at rest


def ticks_since(sample: WheelSample, earlier: WheelSample) -> tuple[int, int]:
    """Of both counters."""
    return (
        tick_difference(sample.left_ticks, earlier.left_ticks),
        tick_difference(sample.right_ticks, earlier.right_ticks),
    )


def _duties(side: int, duty: float) -> tuple[float, float]:
    return (duty, 0.0) if side == 0 else (0.0, duty)


def _pulsed(duty: float, driven: Run) -> Pulsed:
    return Pulsed(duty, driven.ticks, driven.toggles)


def _seconds(samples: list[WheelSample]) -> float:
    return samples[-1].since(samples[0]).dt_s


def _set_duty(robot: BaseDriver, duties: tuple[float, float], seconds: float) -> None:
    try:
        robot.set_duty(*duties, ttl=seconds)
    except DeviceRefused as error:
        if error.code != RefusalCode.FAULT:  # the next sample has a fault
            raise


def _next(robot: BaseDriver, samples: list[WheelSample]) -> WheelSample:
    sample = robot.read()
    if sample.boot_id != samples[0].boot_id:
        raise BoardReset
    return sample


def _clear(robot: BaseDriver, sample: WheelSample) -> None:
    if sample.state is SupervisorState.ESTOPPED:
        raise CommissioningFailed("the e-stop was pressed; begin again when the robot may move")
    if sample.state is not SupervisorState.FAULT:
        return
    if sample.faults & ~_OWN_FAULTS:
        texts = " ".join(f.doc for f in Fault if f in sample.faults)
        raise CommissioningFailed(f"a fault stopped the robot: {texts}")
    robot.clear_fault()
    arm(robot)
