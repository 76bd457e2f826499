"""A raised robot's contact, supply, wiring and wheels, examined step by step.

The wiring is deduced from one pulse of each bridge and what a person saw.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace

from wheelwire_protocol.codes import RefusalCode, SupervisorState

from ...errors import CommissioningFailed, DeviceRefused, fault_names
from ...robot.robot import Robot
from ...samples import WheelSample
from . import driving, problems, questions
from .driving import SIDES, Pair, Pulsed, Record
from .problems import Problem, Unfit
from .questions import Person, Question, Say

RAISED = questions.yes_or_no(
    "raised",
    "Do both wheels hang free, with nothing in their way? They will turn; an e-stop or fault that "
    "is latched will be cleared.",
)

FLOOR = questions.yes_or_no(
    "floor",
    "Does the robot stand on the floor, with a metre free ahead of it? It will drive back and "
    "forth; an e-stop or fault that is latched will be cleared.",
)

_LOWEST_SUPPLY_V = 2.0
_LOW_SUPPLY = 0.6
"""Fraction of `nominal_supply_v`: no battery worth measuring motors with is as empty."""
_STILL_S = 0.5
_REPEATS = 3
_CONFIRM_S = 0.3
_CONFIRM_DUTY = (0.25, 0.6)
_BURST_S = 0.12
_SAG = 0.1
"""Fraction of the supply at rest; a battery in good order gives way by half of that."""
_STEADY_S = 2.0
_STARTED_S = 0.4
_STEADY_DUTY = (0.25, 0.6)
_UNEQUAL = 0.7
_UNEQUAL_START = 1.9


@dataclass(frozen=True)
class Wiring:
    """How motors and encoders are wired to the pins; `left_` is of the left wheel.

    Attributes:
        motors_swapped: The left bridge has the right wheel's motor.
        encoders_swapped: The left counter has the right wheel's encoder.
        left_motor_reversed: Its motor turns backward at a forward duty.
        right_motor_reversed: The same on the right.
        left_encoder_reversed: Its encoder counts down when the wheel turns forward.
        right_encoder_reversed: The same on the right.
    """

    motors_swapped: bool = False
    encoders_swapped: bool = False
    left_motor_reversed: bool = False
    right_motor_reversed: bool = False
    left_encoder_reversed: bool = False
    right_encoder_reversed: bool = False

    @classmethod
    def of_corrections(cls, values: Mapping[str, float]) -> Wiring:
        """The wiring that these parameters correct."""
        # A wire is reversed, and a parameter inverts it: otherwise the names are the same.
        return cls(
            **{f.name: bool(values[f.name.replace("reversed", "inverted")]) for f in fields(cls)}
        )

    @property
    def corrections(self) -> dict[str, float]:
        """The parameters that correct it."""
        return {
            name.replace("reversed", "inverted"): float(wired)
            for name, wired in asdict(self).items()
        }


@dataclass(frozen=True)
class Seen:
    """One bridge was pulsed forward.

    Attributes:
        pulsed: What the counters did.
        answer: `left forward` and the like, `none` or `both`.
    """

    pulsed: Pulsed
    answer: str

    @property
    def wheel(self) -> int | None:
        """The one that turned; None for none and both."""
        return (
            None
            if self.answer in (questions.NONE, questions.BOTH)
            else SIDES.index(self.answer.split()[0])
        )

    @property
    def is_backward(self) -> bool:
        """The way in which it turned."""
        return self.answer.endswith("backward")

    @property
    def counters(self) -> list[int]:
        """The counters that counted."""
        return [side for side in (0, 1) if self.pulsed.counted(side)]


def find_problems(first: Seen, second: Seen) -> list[Problem]:
    """What keeps the wiring from being deduced; not what keeps a wheel from turning."""
    # A defect that concerns both wheels is returned alone: it explains what else was seen.
    seen = (first, second)
    if any(one.answer == questions.BOTH for one in seen):
        return [Problem(problems.BOTH_TURNED)]
    for one in seen:
        if one.wheel is not None and len(one.counters) == 2:
            return [Problem(problems.SAME_ENCODER, one.wheel)]
    found = []
    for one in seen:
        toggled = [side for side in (0, 1) if one.pulsed.toggled(side)]
        if one.wheel is None:
            if one.pulsed.was_noticed:
                found.append(Problem(problems.UNSEEN))
        elif not one.counters and len(toggled) == 2:
            return [Problem(problems.CHANNELS_MIXED)]
        elif not one.counters:
            found.append(
                Problem(problems.CHANNEL_DEAD if toggled else problems.NO_ENCODER, one.wheel)
            )
    if not found and first.counters and first.counters == second.counters:
        return [Problem(problems.SHARED_COUNTER)]
    return found


def deduce(first: Seen, second: Seen) -> Wiring:
    """The wiring, from pulses of the left and of the right bridge without any active correction.

    Each must have turned one wheel and moved one counter: no problems were found.
    """
    wheels = [one.wheel for one in (first, second)]
    # Pulses come by bridge, corrections are by wheel.
    by_wheel = (first, second) if wheels[0] == 0 else (second, first)
    motors = [one.is_backward for one in by_wheel]
    counters = [one.counters[0] for one in by_wheel]
    # Counting up while the wheel turns forward, or down while it turns backward, is right.
    encoders = [
        (one.pulsed.ticks[counter] < 0) != one.is_backward
        for one, counter in zip(by_wheel, counters, strict=True)
    ]
    return Wiring(wheels[0] == 1, counters[0] == 1, *motors, *encoders)


def check_ready(robot: Robot, person: Person) -> None:
    """Ask for free wheels; check the supply and the e-stop contact, and that nothing moves.

    Raises:
        Unfit: The wheels are not free, the contact is open, or there is no supply.
        CommissioningFailed: A fault cannot be cleared, or a wheel turns.
    """
    if person.answer(RAISED) != questions.YES:
        raise Unfit([Problem(problems.ON_THE_FLOOR)])
    _check_still(robot)


def check_floor(robot: Robot, person: Person) -> None:
    """Ask for a free metre; otherwise as `check_ready`.

    Raises:
        Unfit: The contact is open, or there is no supply or too little.
        CommissioningFailed: The floor is not free, a fault cannot be cleared, or a wheel turns.
    """
    if person.answer(FLOOR) != questions.YES:
        raise CommissioningFailed("make room for the robot, then begin again")
    _check_still(robot)
    if low := find_low_battery(robot):
        raise Unfit(low)


def _check_still(robot: Robot) -> None:
    clear(robot)
    sample = driving.fresh(robot)
    # USB may feed the board while the battery is switched off.
    if sample.battery_v is not None and sample.battery_v < _LOWEST_SUPPLY_V:
        raise Unfit([Problem(problems.NO_SUPPLY)])
    start = sample
    while sample.since(start).dt_s < _STILL_S:
        sample = driving.next_sample(robot)
    travel = sample.since(start)
    if max(abs(travel.left), abs(travel.right)) > driving.RESTING_TICKS:
        raise CommissioningFailed("a wheel turns although it is not driven: hold it still")


def find_low_battery(robot: Robot) -> list[Problem]:
    """Whether the battery, as far as it is measured, is too empty to judge a motor by."""
    measured_v, nominal_v = driving.fresh(robot).battery_v, robot.parameters["nominal_supply_v"]
    if measured_v is None or measured_v >= _LOW_SUPPLY * nominal_v:
        return []
    return [
        Problem(
            problems.LOW_BATTERY,
            detail=f"{measured_v:.1f} V, and nominal_supply_v is {nominal_v:g}",
        )
    ]


def clear(robot: Robot) -> None:
    """Clear everything that is latched.

    Raises:
        Unfit: The e-stop's contact is open.
        CommissioningFailed: A fault lasts.
    """
    sample = driving.fresh(robot)
    try:
        if sample.state is SupervisorState.ESTOPPED:
            robot.clear_estop()
            sample = driving.fresh(robot)
        # A fault that the e-stop hid is active again once that is cleared.
        if sample.state is SupervisorState.FAULT:
            robot.clear_fault()
        # Even if nothing was latched: choosing a board has restarted the robot.
        driving.arm(robot)
    except DeviceRefused as error:
        if error.code != RefusalCode.CAUSE_PRESENT:
            raise
        # `sample` is from before the refused request, so its state tells which one that was.
        if sample.state is SupervisorState.ESTOPPED:
            raise Unfit([Problem(problems.CONTACT_OPEN)]) from error
        raise CommissioningFailed(f"a fault lasts: {driving.meaning_of(sample.faults)}") from error


def find_wiring(robot: Robot, person: Person, say: Say) -> tuple[Wiring, Sequence[Pulsed]]:
    """The wiring, by two pulses and two answers. No correction may be active.

    Returns:
        The wiring, and what the pulses of both bridges did.

    Raises:
        Unfit: No wiring explains what was seen.
        CommissioningFailed: The board was reset, or a fault or e-stop stopped the robot.
    """
    say("One motor is pulsed, gently at first. Watch which wheel turns.")
    # A wheel that counts against its drive is not a fault yet. The fault would end a pulse before
    # anybody has seen the wheel turn.
    with driving.not_watching(robot, "reversal_duty"):
        first = _ask(
            robot, person, "first", 0, (*questions.WHEEL_AND_WAY, questions.NONE, questions.BOTH)
        )
        other = None if first.wheel is None else 1 - first.wheel
        say("Now the other motor.")
        choices = questions.WHEEL_AND_WAY if other is None else ("forward", "backward")
        second = _ask(robot, person, "second", 1, (*choices, questions.NONE, questions.BOTH))
        # Asked about the other wheel alone, a person answers only which way it turned.
        if other is not None and second.answer in choices:
            second = Seen(second.pulsed, f"{SIDES[other]} {second.answer}")
        # Not before both answers: the first wheel is not to be seen when the second is asked for.
        first, second = (
            _harder_if_unnoticed(robot, 0, first),
            _harder_if_unnoticed(robot, 1, second),
        )
    found = find_problems(first, second)
    # Pulses alone do not tell a dead motor from a blocked wheel or a missing supply: a hand does.
    if not found or any(one.answer == questions.NONE for one in (first, second)):
        found += _motionless(robot, person, first, second)
    if found:
        # A wheel that hardly moves looks like many things.
        raise Unfit(find_low_battery(robot) or found)
    return deduce(first, second), (first.pulsed, second.pulsed)


def _ask(robot: Robot, person: Person, key: str, side: int, choices: tuple[str, ...]) -> Seen:
    text = "Which wheel turned, seen from behind, and which way?"
    if questions.WHEEL_AND_WAY[0] not in choices:
        text = "Which way did the other wheel turn?"
    question = Question(key, text, (*choices, questions.AGAIN), questions.AGAIN)
    seen = _ask_until_seen(robot, person, question, side, driving.pulse(robot, side))
    if seen.pulsed.was_noticed or seen.answer != questions.NONE:
        return seen
    # A low supply, much friction or a weak motor: where nothing turned, nothing turns far.
    harder = driving.pulse_harder(robot, side)
    if harder.was_noticed:
        return _ask_until_seen(robot, person, question, side, harder)
    return Seen(harder, questions.NONE)


def _harder_if_unnoticed(robot: Robot, side: int, seen: Seen) -> Seen:
    """A file of answers knows the wheel, and the way, that only a harder pulse turns."""
    if seen.wheel is None or seen.pulsed.was_noticed:
        return seen
    return Seen(driving.pulse_harder(robot, side), seen.answer)


def _ask_until_seen(
    robot: Robot, person: Person, question: Question, side: int, pulsed: Pulsed
) -> Seen:
    # No counter noticed this wheel, so nothing shows how far it has turned: it is shown only once
    # more.
    for _ in range(_REPEATS if pulsed.was_noticed else 1):
        if (answer := person.answer(question)) != questions.AGAIN:
            return Seen(pulsed, answer)
        shown = driving.show(robot, side, pulsed)
        pulsed = pulsed if pulsed.was_noticed else shown
    # More turns would be too many for an unknown wheel.
    last = replace(question, choices=question.choices[:-1], default=questions.NONE)
    return Seen(pulsed, person.answer(last))


def _motionless(robot: Robot, person: Person, first: Seen, second: Seen) -> list[Problem]:
    """What is wrong with wheels that no pulse turned, found with a hand on them."""
    bridges = [side for side, seen in enumerate((first, second)) if seen.answer == questions.NONE]
    # If a counter moved, the wheel is not motionless: `find_problems` has reported the problem.
    if not bridges or any(
        one.pulsed.was_noticed for one in (first, second) if one.answer == questions.NONE
    ):
        return []
    moved = [one.wheel for one in (first, second) if one.wheel is not None]
    wheels = [side for side in (0, 1) if side not in moved]
    hands = {wheel: _by_hand(robot, person, wheel) for wheel in wheels}
    works = [
        wheel for wheel, (answer, counted) in hands.items() if counted and answer != questions.HELD
    ]
    # If both wheels count when they are turned by hand, what is missing is what the motors share.
    if len(works) == 2 or (
        all(answer == questions.SKIP for answer, _ in hands.values()) and len(wheels) == 2
    ):
        return [Problem(problems.NO_SUPPLY)]
    return [_problem_of(wheel, *hands[wheel]) for wheel in wheels]


def _by_hand(robot: Robot, person: Person, wheel: int) -> tuple[str, bool]:
    """The answer, and whether a counter counted."""
    before = driving.fresh(robot)
    answer = person.answer(
        Question(
            f"hand_{SIDES[wheel]}",
            f"The {SIDES[wheel]} wheel did not turn. Turn it by hand, about half a turn. "
            "Could it be turned?",
            (questions.TURNED, questions.HELD, questions.SKIP),
            questions.TURNED,
            turn=questions.HandTurn(wheel, 0.5),
        )
    )
    # Either counter: the encoders may be swapped.
    ticks = driving.fresh(robot).since(before)[:2]
    return answer, max(map(abs, ticks)) >= driving.COUNTED_TICKS


def _problem_of(wheel: int, answer: str, counted: bool) -> Problem:
    if answer == questions.HELD:
        return Problem(problems.BLOCKED, wheel)
    if counted or answer == questions.SKIP:
        return Problem(problems.NO_MOTOR, wheel)
    return Problem(problems.NO_ENCODER, wheel)


def confirm(robot: Robot, pulsed: Sequence[float]) -> float:
    """Drive both wheels forward for a moment, with the corrections active.

    Args:
        robot: The robot, with corrected wiring.
        pulsed: The duty that set each wheel in motion; empty if that is not known.

    Returns:
        A duty at which both wheels turn.

    Raises:
        Unfit: A counter did not count up.
        CommissioningFailed: The board was reset, or a fault or e-stop stopped the robot.
    """
    low, high = _CONFIRM_DUTY
    duty = min(max(1.5 * max(pulsed, default=high), low), high)
    driven = driving.run(robot, Pair(duty, duty), _CONFIRM_S)
    # With a low supply or much friction no wheel may turn. That proves nothing about the wiring.
    if min(map(abs, driven.ticks)) < driving.COUNTED_TICKS:
        duty = 1.0
        driven = driving.run(robot, Pair(duty, duty), _CONFIRM_S)
    wrong = [side for side in (0, 1) if driven.ticks[side] < driving.COUNTED_TICKS]
    if wrong:
        detail = " and ".join(f"the {SIDES[w]} wheel counted {driven.ticks[w]}" for w in wrong)
        raise Unfit([Problem(problems.NOT_CONFIRMED, detail=detail)])
    return duty


def check_supply(robot: Robot) -> list[Problem]:
    """Start both motors at once with full duty, and watch the supply.

    Raises:
        Unfit: The board was reset by it.
    """
    # Two motors that start from rest at full duty draw the most current.
    try:
        burst = driving.run(robot, Pair(1.0, 1.0), _BURST_S)
    except driving.BoardReset as error:
        raise Unfit([Problem(problems.SAGS, detail=" so far that the board is reset")]) from error
    volts = [s.battery_v for s in burst.samples if s.battery_v is not None]
    # If the battery is measured at all, each sample has it.
    if not volts or (low_v := min(volts)) > (1 - _SAG) * (rest_v := volts[0]):
        return []
    return [Problem(problems.SAGS, detail=f" from {rest_v:.1f} to {low_v:.1f} V")]


def check_wheels(robot: Robot, pulsed: Sequence[float], turning: float) -> list[Problem]:
    """Turn both wheels for two seconds, and compare them.

    Args:
        robot: The robot, with corrected wiring.
        pulsed: The duty that set each wheel in motion; empty if that is not known.
        turning: A duty at which both turn.

    Raises:
        Unfit: A fault of a wheel stopped the robot.
        CommissioningFailed: The board was reset, or a fault or e-stop stopped the robot.
    """
    low, high = _STEADY_DUTY
    # Well beyond what starts them, so that both turn steadily.
    duty = max(min(max(3 * max(pulsed, default=high), low), high), turning)
    driven = driving.run(robot, Pair(duty, duty), _STEADY_S)
    if driven.faults:
        raise Unfit([Problem(problems.FAULTED, detail=fault_names(driven.faults))])
    gaps = [side for side in (0, 1) if driving.has_gap(_at_steady_speed(driven, side, duty), side)]
    # Where no edge comes, a wheel seems to start late.
    unequal = _unequal(driven, () if gaps else pulsed)
    # At a low voltage a little more friction is a great difference.
    if find_low_battery(robot):
        unequal = []
    return unequal + [Problem(problems.MAGNET_MISSING, side) for side in gaps]


def _unequal(driven: Record, pulsed: Sequence[float]) -> list[Problem]:
    left, right = driven.ticks
    slow = 0 if left < right else 1
    ratio = driven.ticks[slow] / max(*driven.ticks, 1)
    if ratio < _UNEQUAL:
        detail = f" has {ratio:.0%} of the other one's speed at the same duty"
        return [Problem(problems.WEAK, slow, detail)]
    if not pulsed:
        return []
    stiff = 0 if pulsed[0] > pulsed[1] else 1
    ratio = pulsed[stiff] / min(pulsed)
    if ratio > _UNEQUAL_START:
        return [Problem(problems.WEAK, stiff, f" starts at {ratio:.1f} times the other one's duty")]
    return []


def _at_steady_speed(driven: Record, side: int, duty: float) -> list[WheelSample]:
    """Neither while the wheels start nor while they roll out."""
    first = driven.samples[0]
    return [
        sample
        for sample in driven.samples
        if sample.since(first).dt_s > _STARTED_S and driving.duty_of(sample, side) > 0.9 * duty
    ]
