"""A device's black box: its file, its re-run, and why the robot stopped, by the box alone.

No host needs to have been there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from statistics import median

from wheelwire_protocol import types as wire
from wheelwire_protocol.black_box import (
    BOX_SIZE,
    PARTS,
    Box,
    BoxError,
    BoxHead,
    Contact,
    End,
    HangUp,
    Received,
    Refusal,
    Rerun,
    RerunOutcome,
    Step,
    Stored,
    Transition,
    core_hash,
)
from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import (
    BoxCause,
    Fault,
    RefusalCode,
    SupervisorEvent,
    SupervisorState,
    TrialAction,
)

from ...errors import RecordingError
from ...link.clock import Conversion
from ...link.sample_stream import DUTY_SCALE, Measurement
from ...link.setpoints import SETPOINT_IDS
from . import wheel_fault
from .causes import (
    COUNTING_FAULTS,
    ESTOPPED,
    OTHER_FAULTS,
    REFUSALS,
    RESETS,
    WHEEL_FAULTS,
    latched_causes,
)
from .diagnosis import Stop, stop_of, supply_fall


def read_box(path: Path) -> Box:
    """The black box in this file.

    Raises:
        RecordingError: It cannot be read, or is not a black box.
        NativeMissingError: The firmware's library is missing or of another release.
    """
    try:
        with path.open("rb") as file:
            # One byte more shows a file that is longer.
            return Box(file.read(BOX_SIZE + 1))
    except OSError as error:
        raise RecordingError(
            f"cannot read {path}: {error.strerror or error}; name the file of a black box"
        ) from None
    except BoxError as error:
        raise RecordingError(
            f"{path} is {error}: name a file of {BOX_SIZE} bytes that was read from a robot"
        ) from None


def rerun_box(path: Path) -> Rerun:
    """Give the inputs in this file to the firmware's core again, in virtual time.

    Raises:
        RecordingError: It cannot be read, is not a black box, or is from another core.
        NativeMissingError: The firmware's library is missing or of another release.
    """
    box = read_box(path)
    head = box.head
    if head.core != core_hash():
        raise RecordingError(
            f"{path} is of the core {head.core:08x} (firmware {head.release}, commit "
            f"{head.git_hash:08x}), and this is {core_hash():08x}: re-run it with the library of "
            "that release or commit"
        )
    rerun = box.rerun()
    if rerun.outcome is RerunOutcome.UNREADABLE:
        raise RecordingError(
            f"{path} is damaged: the robot's state in it cannot be read; read the box "
            "from the robot again"
        )
    if rerun.outcome is RerunOutcome.EMPTY:
        raise RecordingError(
            f"{path} is empty: it was stored before the robot made a step; choose another box"
        )
    return rerun


SPACING_US = 10_000
"""Spacing of the samples that are made of steps: as of a host's, for which
`wheel_fault` is made."""
SAME_STEP_US = 2_000
"""A message that came this shortly before a change of state is its cause."""
COUNTER_LIMIT = 32_767
"""The counters return to 0 at this count."""
STILL_US = 300_000
"""A wheel that does not count has stood still for this long."""
STILL_TICKS, TURNED_TICKS = 2, 5
"""Ticks of a wheel that stands, and of one that turns, within `STILL_US`."""
MISSED = 2
"""A program that sends no more setpoints has missed this many."""
LATE = 1.5
"""A step is late when it takes this many times the usual time."""

_SILENT = ("host_killed", "host_frozen", "cable_pulled", "line_corrupt")
"""Causes that look the same in a box: as silence."""
_OF_A_SESSION = (wire.SetWheelVelocity, wire.SetDuty, wire.Ping)


def stops_of_box(box: Box, added_us: int = 0) -> list[Stop]:
    """The stops that a black box is of; none if nothing in it stopped the robot.

    There are two if a fault or an e-stop had ended it and a reset came before it was stored.

    Args:
        box: The box of any device.
        added_us: The difference from the device's clock, in the boot that was recorded, to the
            host's. None: unknown, and the stop's time is on the device's clock.

    Raises:
        BoxError: A record has a code of a later release.
    """
    story = _Story.of(box)
    is_reset = box.head.cause is BoxCause.RESET
    stops = []
    if story.stop is not None and (story.is_ended or not is_reset):
        stops.append(_stop_in(story, story.stop, added_us))
    if is_reset:
        stops.append(_reset(story, added_us))
    return stops


def _stop_in(story: _Story, stop: Transition, added_us: int) -> Stop:
    causes, evidence, side = _JUDGES[stop.event](story, stop)
    head = story.box.head
    when = f"{stop.t_us / 1e6:.2f} s after the start of boot {head.boot_id:08x}"
    shown = (f"black box {head.number}: {when}", *_missing(story.box), *evidence)
    return stop_of(stop.t_us + added_us, causes, shown, side)


def stop_of_damaged_box(head: BoxHead, error: BoxError, added_us: int = 0) -> Stop:
    """The stop of a stored black box whose records cannot be read, as far as its head tells.

    Args:
        head: The box's head.
        error: Why it cannot be read.
        added_us: As of `stops_of_box`. The stop came some time before what was stored.
    """
    evidence = [
        f"black box {head.number} of boot {head.boot_id:08x} cannot be read: {error}",
        f"its header says: {head.cause.name}. {head.cause.doc}",
        f"it was stored {head.stored_us / 1e6:.2f} s after a start, some time after the stop",
    ]
    causes: tuple[str, ...] = ESTOPPED
    side = ""
    if head.cause is BoxCause.RESET:
        causes = (RESETS[head.reset_reason],)
        evidence.append(f"{head.reset_reason.name}. {head.reset_reason.doc}")
    elif head.cause is BoxCause.FAULT:
        found = list(latched_causes(head.faults))
        evidence += [f"{fault.name}: {fault.doc}" for fault, _, _ in found]
        # The head does not name faults that were cleared before it was stored.
        causes = tuple(dict.fromkeys(name for _, names, _ in found for name in names)) or (
            "box_damaged",
        )
        side = found[0][2] if len(found) == 1 else ""
    return stop_of(head.stored_us + added_us, causes, evidence, side)


def _missing(box: Box) -> tuple[str, ...]:
    if not box.missing:
        return ()
    return (
        f"{box.missing} of its {PARTS} parts, the oldest, cannot be read: a reset came while one "
        "was written, or damaged the memory",
    )


@dataclass
class _Story:
    """The records of a box, by kinds."""

    box: Box
    steps: list[Step] = field(default_factory=list)
    transitions: list[Transition] = field(default_factory=list)
    received: list[Received] = field(default_factory=list)
    refusals: list[Refusal] = field(default_factory=list)
    others: list[Contact | HangUp | Stored] = field(default_factory=list)
    is_ended: bool = False
    """A fault or an e-stop has ended it: what came later is not in it."""
    session_id: int | None = None
    """That was open at the end, as far as the box tells."""

    @classmethod
    def of(cls, box: Box) -> _Story:
        story = cls(box)
        before: int | None = None
        for entry in box.entries():
            match entry:
                case Step():
                    story.steps.append(entry)
                case Transition():
                    story.transitions.append(entry)
                case Received():
                    story.received.append(entry)
                    before = story.session_id
                    story._enter(entry.message)
                case Refusal():
                    story.refusals.append(entry)
                    if entry.code is RefusalCode.NO_SESSION:
                        story.session_id = before
                case Contact() | HangUp() | Stored():
                    story.others.append(entry)
                case End():
                    story.is_ended = True
        return story

    def _enter(self, message: wire.AnyMessage) -> None:
        if isinstance(message, wire.Hello):
            self.session_id = message.nonce ^ self.box.head.boot_id
        elif isinstance(message, _OF_A_SESSION):
            self.session_id = message.session_id

    @property
    def stop(self) -> Transition | None:
        """The last change of state that took the drive away, or latched."""
        latching = (SupervisorEvent.FAULT, SupervisorEvent.ESTOP)
        for one in reversed(self.transitions):
            is_end = one.before is SupervisorState.DRIVING and one.event in _JUDGES
            if is_end or one.event in latching:
                return one
        return None

    def samples(self, until_us: int) -> Iterator[Measurement]:
        """The steps as a host would have seen them."""
        left, right = 0, 0
        state = self.transitions[0].before if self.transitions else SupervisorState.DRIVING
        changes = iter([*self.transitions, None])
        change = next(changes)
        taken_us = -SPACING_US
        # The first one has none before it: nothing was counted up to it.
        for before, step in pairwise([*self.steps[:1], *self.steps]):
            if step.t_us > until_us:
                return
            left += _change(before.left_counter, step.left_counter)
            right += _change(before.right_counter, step.right_counter)
            while change is not None and change.t_us < step.t_us:
                state, change = change.after, next(changes)
            if step.t_us >= taken_us + SPACING_US:
                taken_us = step.t_us
                yield _measurement(step, left, right, state)

    def last(self, kind: type[wire.AnyMessage], until_us: int) -> Received | None:
        """The newest message of this kind."""
        found = [
            one for one in self.received if isinstance(one.message, kind) and one.t_us <= until_us
        ]
        return found[-1] if found else None

    def just_before(self, kind: type[wire.AnyMessage], t_us: int) -> Received | None:
        """A message of this kind that may be the cause."""
        found = self.last(kind, t_us)
        return found if found is not None and found.t_us >= t_us - SAME_STEP_US else None


_Judged = tuple[tuple[str, ...], Iterable[str], str]


def _fault(story: _Story, stop: Transition) -> _Judged:
    known = [one for one in story.transitions if one.t_us <= stop.t_us and one is not stop]
    new = stop.faults & ~(known[-1].faults if known else Fault(0)) or stop.faults
    samples = tuple(story.samples(stop.t_us))
    supply = supply_fall(samples)
    names = ", ".join(str(one.name) for one in Fault if one in new)
    for one, name in OTHER_FAULTS.items():
        if one in new:
            late = _late(story, stop.t_us) if one is Fault.CONTROL_OVERRUN else ()
            return (name,), (f"{names}: {one.doc}", *late, *supply), ""
    for one, (side, name) in WHEEL_FAULTS.items():
        if one not in new:
            continue
        if name == "wheel_reversed":
            return (name,), (names, *supply), side
        if one & COUNTING_FAULTS and _has_others_count(samples, side):
            samples = tuple(map(_swapped, samples))
        causes, evidence = wheel_fault.examine(samples, side, counting=not one & COUNTING_FAULTS)
        if causes == ("wheel_never_counted",) and samples[0].supervisor is SupervisorState.DRIVING:
            # Whether it had counted before is not in the box.
            causes = ("encoder_dead", "wheel_blocked", "motor_open")
            evidence = ("not one tick in the box, which begins in the drive",)
        return causes, (names, *evidence, *supply), side
    return ("external_fault",), (names,), ""


def _has_others_count(samples: tuple[Measurement, ...], side: str) -> bool:
    """Whether the counters are swapped: this one goes on, and the other one stands."""
    if not samples:
        return False
    last = samples[-1]
    before = next(one for one in samples if one.t_us >= last.t_us - STILL_US)
    left = abs(last.state.left_ticks - before.state.left_ticks)
    right = abs(last.state.right_ticks - before.state.right_ticks)
    own, other = (left, right) if side == "left" else (right, left)
    return own >= TURNED_TICKS and other <= STILL_TICKS


def _swapped(one: Measurement) -> Measurement:
    state = one.state._replace(left_ticks=one.state.right_ticks, right_ticks=one.state.left_ticks)
    return Measurement(state, one.t_us, Conversion(()), one.arrived_us)


def _late(story: _Story, until_us: int) -> tuple[str, ...]:
    """The longest time between two steps, and what the device did in it."""
    steps = [one for one in story.steps if one.t_us <= until_us]
    gaps = [(later.t_us - earlier.t_us, earlier.t_us) for earlier, later in pairwise(steps)]
    if not gaps:
        return ()
    longest_us, begin_us = max(gaps)
    usual_us = median(gap for gap, _ in gaps)
    if longest_us < LATE * usual_us:
        return ()
    text = f"a step came {(longest_us - usual_us) / 1000:.1f} ms late"
    stored = any(
        isinstance(one, Stored) and begin_us <= one.t_us <= begin_us + longest_us
        for one in story.others
    )
    return (text, "flash was written just before") if stored else (text,)


def _estop(story: _Story, stop: Transition) -> _Judged:
    contacts = [one for one in story.others if isinstance(one, Contact) and one.t_us <= stop.t_us]
    if contacts and contacts[-1].open:
        return ("contact_open",), ("the contact opened just before",), ""
    return _asked(story, stop, wire.Estop, "estop")


def _stop(story: _Story, stop: Transition) -> _Judged:
    ends = [one for one in story.others if isinstance(one, HangUp)]
    if ends and stop.t_us - SAME_STEP_US <= ends[-1].t_us <= stop.t_us:
        return ("host_hung_up",), ("the end of the connection came just before",), ""
    trial = story.just_before(wire.ParameterTrial, stop.t_us)
    if trial is not None and getattr(trial.message, "action", None) == TrialAction.REVERT:
        return ("stop_by_session",), ("a program reverted its trial of parameters",), ""
    if story.just_before(wire.Stop, stop.t_us) is None:
        return ("trial_expired",), ("no Stop was read: the device stopped by itself",), ""
    return _asked(story, stop, wire.Stop, "stop")


def _asked(
    story: _Story, stop: Transition, kind: type[wire.Estop | wire.Stop], what: str
) -> _Judged:
    """Whether the open session asked, or another program."""
    session, stranger = f"{what}_by_session", f"{what}_by_stranger"
    read = story.just_before(kind, stop.t_us)
    if read is None:
        return (session, stranger), (f"no {kind.__name__} is in the box just before",), ""
    asked = getattr(read.message, "session_id", 0)
    text = f"the message {kind.__name__} was read just before"
    if story.session_id is None:
        return (session, stranger), (text, "which session was open is not in the box"), ""
    if asked == story.session_id:
        return (session,), (text, "it came in the session that was open"), ""
    return (stranger,), (text, "of another session, or of none"), ""


def _new_session(story: _Story, stop: Transition) -> _Judged:
    hello = story.just_before(wire.Hello, stop.t_us)
    nonce = f"{getattr(hello.message, 'nonce', 0):08x}" if hello is not None else "unknown"
    return ("new_session",), (f"a Hello with the nonce {nonce} was read just before",), ""


def _deadline(story: _Story, stop: Transition) -> _Judged:
    asked = [story.last(wire.SetWheelVelocity, stop.t_us), story.last(wire.SetDuty, stop.t_us)]
    times = [one.t_us for one in asked if one is not None]
    if not times:
        return ("program_paused", *_SILENT), ("no setpoint is in the box",), ""
    refused = [
        one for one in story.refusals if one.message_id in SETPOINT_IDS and one.t_us <= stop.t_us
    ]
    if refused and refused[-1].t_us >= max(times) - SAME_STEP_US:
        code = refused[-1].code
        name = REFUSALS.get(code, "setpoints_refused")
        return (name,), (f"the last setpoint was refused: {code.name}. {code.doc}",), ""
    quiet_s = (stop.t_us - max(times)) / 1e6
    evidence = [f"the last setpoint came {quiet_s:.2f} s before"]
    others = [one.t_us for one in story.received if one.t_us <= stop.t_us]
    # Messages between two setpoints do not show what the program did after the last one.
    if others[-1] > max(times) + MISSED * _setpoint_period_us(story):
        text = (
            f"a message other than a setpoint came {(others[-1] - max(times)) / 1e6:.2f} s after it"
        )
        return ("program_paused",), (*evidence, text), ""
    evidence.append("nothing came since: a black box cannot tell these apart")
    return ("program_paused", *_SILENT), evidence, ""


def _setpoint_period_us(story: _Story) -> float:
    times = [one.t_us for one in story.received if message_id(type(one.message)) in SETPOINT_IDS]
    gaps = [later - earlier for earlier, later in pairwise(times)]
    return median(gaps) if gaps else SPACING_US


_JUDGES: dict[SupervisorEvent, Callable[[_Story, Transition], _Judged]] = {
    SupervisorEvent.FAULT: _fault,
    SupervisorEvent.ESTOP: _estop,
    SupervisorEvent.STOP: _stop,
    SupervisorEvent.SESSION: _new_session,
    SupervisorEvent.DEADLINE: _deadline,
}


def _reset(story: _Story, added_us: int) -> Stop:
    head = story.box.head
    reason = head.reset_reason
    evidence = [
        f"black box {head.number}, of boot {head.boot_id:08x}, which this reset ended: "
        f"{reason.name}. {reason.doc}",
        *_missing(story.box),
    ]
    end_us = head.stored_us
    if story.is_ended and story.stop is not None:
        evidence.append("a fault or an e-stop had ended the box earlier; the box does not say when")
        return stop_of(story.stop.t_us + added_us, (RESETS[reason],), evidence)
    if story.steps:
        last = story.steps[-1]
        end_us = last.t_us
        duties = [abs(duty) / DUTY_SCALE for duty in (last.left_duty_q15, last.right_duty_q15)]
        evidence.append(
            f"its last control step came {end_us / 1e6:.2f} s after the start, driven at "
            f"{duties[0]:.0%} and {duties[1]:.0%}"
        )
    if story.received:
        read = story.received[-1]
        evidence.append(
            f"the last message was {type(read.message).__name__}, "
            f"{max(0, end_us - read.t_us) / 1000:.0f} ms before the reset"
        )
    if story.stop is not None:
        stop = story.stop
        evidence.append(
            f"{(end_us - stop.t_us) / 1e6:.2f} s before the reset it had stopped: "
            f"{stop.event.name}. {stop.event.doc}"
        )
    evidence += supply_fall(tuple(story.samples(end_us)))
    return stop_of(end_us + added_us, (RESETS[reason],), evidence)


def _change(before: int, now: int) -> int:
    """The true change of a counter, as the core computes it."""
    return (now - before + COUNTER_LIMIT // 2) % COUNTER_LIMIT - COUNTER_LIMIT // 2


def _measurement(step: Step, left: int, right: int, state: SupervisorState) -> Measurement:
    frame = wire.WheelState(
        boot_id=0,
        t_us=step.t_us & 0xFFFFFFFF,
        left_ticks=left,
        right_ticks=right,
        left_mps=0.0,
        right_mps=0.0,
        left_duty_q15=step.left_duty_q15,
        right_duty_q15=step.right_duty_q15,
        command_seq=0,
        supervisor=state,
        faults=0,
        overruns=0,
        battery_mv=step.battery_mv,
    )
    return Measurement(frame, step.t_us, Conversion(()), step.t_us)
