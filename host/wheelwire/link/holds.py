"""What holds a robot, and what ended its last motion, in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from wheelwire_protocol.codes import (
    Contradiction,
    EstopSource,
    Fault,
    Held,
    ResetReason,
    StopCause,
    StopFlag,
)
from wheelwire_protocol.types import Hold

_NO_HOLD, _NO_FAULT, _NO_CONTRADICTION = Held(0), Fault(0), Contradiction(0)
UNARMED = Held.UNARMED | Held.UNARMED_FORWARD | Held.UNARMED_REVERSE
UNKNOWN_STOP = "What ended its last motion is unknown: it has not moved yet, or it lost power."


@dataclass(frozen=True)
class HeldBy:
    """What keeps a robot from driving now, or from driving one way; false if nothing does.

    `str` says it in words, and `for flag in held_by` gives each flag of `Held`, whose `name` and
    `doc` are the stable code and its sentence.

    Attributes:
        flags: All that applies.
        estop_source: With ESTOP, what latched it.
        contradictions: With CONTRADICTION, which parameters contradict each other.
        faults: With FAULT, the latched faults.
    """

    flags: Held = _NO_HOLD
    estop_source: EstopSource = EstopSource.NONE
    contradictions: Contradiction = _NO_CONTRADICTION
    faults: Fault = _NO_FAULT

    @classmethod
    def of(cls, hold: Hold, faults: Fault) -> HeldBy:
        """From the device's report.

        Raises:
            ValueError: It has a code that is not known.
        """
        flags = Held(hold.held)
        return cls(
            flags,
            EstopSource(hold.estop_source),
            Contradiction(hold.contradictions),
            faults if Held.FAULT in flags else _NO_FAULT,
        )

    def __bool__(self) -> bool:
        return bool(self.flags)

    def __iter__(self) -> Iterator[Held]:
        return (flag for flag in Held if flag in self.flags)

    def __contains__(self, flag: Held) -> bool:
        return flag in self.flags

    @property
    def names(self) -> tuple[str, ...]:
        """The stable codes, such as BUMPER_FRONT."""
        return tuple(str(flag.name) for flag in self)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What each of them means, and what to do."""
        return tuple(self.sentence(flag) for flag in self)

    def sentence(self, flag: Held) -> str:
        """What one of them means here, and what to do."""
        if flag is Held.ESTOP and self.estop_source is not EstopSource.NONE:
            return f"{flag.doc} Who latched it: {_lowered(self.estop_source.doc)}"
        details: tuple[str, ...] = ()
        if flag is Held.FAULT:
            details = tuple(f"{one.name}: {one.doc}" for one in Fault if one in self.faults)
        elif flag is Held.CONTRADICTION:
            details = tuple(one.doc for one in Contradiction if one in self.contradictions)
        return " ".join((flag.doc, *details))

    def __str__(self) -> str:
        return " ".join(self.sentences) if self else "Nothing holds it."


class Program(NamedTuple):
    """A program of this computer that has driven the robot.

    Attributes:
        pid: Its process.
        started: When that began, in the kernel's own unit: another process may have the number now.
        command: Its command line.
    """

    pid: int
    started: int
    command: str

    @property
    def is_running(self) -> bool:
        """Whether it runs still."""
        return self.started == start_of(self.pid)

    def __str__(self) -> str:
        fate = "runs still" if self.is_running else "has ended"
        return f"`{self.command}`, process {self.pid}, which {fate}"


def start_of(pid: int) -> int | None:
    """When a process began, since the computer started; None if there is none."""
    try:
        # Behind the name, which may have spaces and brackets in it.
        fields = Path(f"/proc/{pid}/stat").read_text("utf-8", "replace").rpartition(")")[2].split()
        return None if fields[0] in "ZX" else int(fields[19])
    except (OSError, ValueError, IndexError):
        return None


class LastStop(NamedTuple):
    """What ended a robot's last motion. `str` says it in words.

    Attributes:
        cause: Its stable code, `cause.name`, with a sentence, `cause.doc`. UNKNOWN: the robot has
            not moved since it got its power, or the record was lost.
        reset_reason: With RESET, why the device was reset.
        held: The sensors that held the robot at that moment.
        faults: The faults that were latched then.
        session_id: The session whose setpoint drove until then.
        command_seq: Number of that setpoint; 0: not known.
        t_us: The device's clock at that moment; None: before the device last started. [us]
        stamp: The same on this host's `time.monotonic()`; None: not known. [s]
        speed_mps: Of the faster wheel at that moment. [m/s]
        rolled_m: How far that wheel has turned since then. [m]
        is_at_rest: The wheels have come to rest, so `rolled_m` is final.
        program: The program that drove; None if it ran on another computer, or is not remembered.
    """

    cause: StopCause = StopCause.UNKNOWN
    reset_reason: ResetReason | None = None
    held: Held = _NO_HOLD
    faults: Fault = _NO_FAULT
    session_id: int = 0
    command_seq: int = 0
    t_us: int | None = None
    stamp: float | None = None
    speed_mps: float = 0.0
    rolled_m: float = 0.0
    is_at_rest: bool = False
    program: Program | None = None

    @classmethod
    def of(cls, hold: Hold, stamp: float | None) -> LastStop:
        """From the device's report, with the `stamp` that the host knows.

        Raises:
            ValueError: It has a code that is not known.
        """
        cause = StopCause(hold.stop_cause)
        if cause is StopCause.UNKNOWN:
            return cls()
        return cls(
            cause,
            ResetReason(hold.stop_reset) if cause is StopCause.RESET else None,
            Held(hold.stop_held),
            Fault(hold.stop_faults),
            hold.stop_session,
            hold.stop_command,
            hold.stop_us or None,
            stamp if hold.stop_us else None,
            hold.stop_mmps / 1000,
            hold.rolled_mm / 1000,
            bool(hold.stop_flags & StopFlag.AT_REST),
        )

    @property
    def was_earlier_start(self) -> bool:
        """It was before the device last started."""
        return self.t_us is None and self.cause is not StopCause.UNKNOWN

    @property
    def evidence(self) -> tuple[str, ...]:
        """What is known of it apart from its cause."""
        return tuple(self._evidence())

    def _evidence(self) -> Iterator[str]:
        if self.cause is StopCause.UNKNOWN:
            return
        if self.reset_reason is not None:
            yield f"the reset: {self.reset_reason.name}. {self.reset_reason.doc}"
        yield from (f"{flag.name}: {flag.doc}" for flag in Held if flag in self.held)
        yield from (f"{fault.name}: {fault.doc}" for fault in Fault if fault in self.faults)
        if self.cause is not StopCause.RESET:
            yield f"it went at {self.speed_mps:.2f} m/s, and {self._rolled}"
        if self.command_seq:
            yield f"it had obeyed the setpoint {self.command_seq} of its session"
        if self.was_earlier_start:
            yield "it was before the device last started"
        if self.program is not None:
            yield f"the program that drove: {self.program}"

    @property
    def _rolled(self) -> str:
        if self.is_at_rest:
            return f"came to rest {self.rolled_m:.2f} m farther on"
        return f"had rolled {self.rolled_m:.2f} m since, by the newest report"

    def __str__(self) -> str:
        if self.cause is StopCause.UNKNOWN:
            return UNKNOWN_STOP
        return " ".join((self.cause.doc, *(f"{_raised(text)}." for text in self.evidence)))


class Holding(NamedTuple):
    """What holds a robot, and what ended its last motion."""

    held_by: HeldBy
    last_stop: LastStop


def _lowered(text: str) -> str:
    return text[0].lower() + text[1:]


def _raised(text: str) -> str:
    return (text[0].upper() + text[1:]).removesuffix(".")
