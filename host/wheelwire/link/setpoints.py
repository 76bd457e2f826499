"""Setpoints: whether one may be sent, its frame, and its one repeat; never renewed. Sans-IO.

Any thread may ask for one and write it while the port's thread receives. Nothing is locked: what
both touch is replaced in one assignment.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Collection
from itertools import count
from typing import NamedTuple, Protocol, TypeAlias

from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import Held, RefusalCode, StopMode, SupervisorState
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import AnyMessage, Estop, Refuse, SetDuty, SetWheelVelocity, Stop

from ..errors import NO_FAULT, DeviceRefused, Expired, WheelwireError, afresh
from .clock import ClockEstimator
from .holds import UNARMED
from .requests import COPY_ID, HeldTrial
from .sample_stream import DUTY_SCALE
from .traffic import ESTOP, Kind, Traffic

REPEAT_AFTER_US = 20_000
"""Time for a state frame to show that the setpoint arrived, at 100 frames a second."""
REARM_GAP = PARAMETER_BY_NAME["rearm_gap_s"]
TTL_MAX = PARAMETER_BY_NAME["ttl_max_s"]
HELD = (
    "the robot is held: unarmed; send a zero setpoint (robot.set_velocity(0, 0)) or pause for %g s"
)

LATE = 5
"""Warn after this many setpoints in a row came too late."""
ALL_LATE = (
    "the setpoints arrive too late, so the robot does not drive: give them a longer ttl, or see "
    "what holds up this computer or the line"
)

ASKED = struct.Struct("<ddq")
"""Left, right and expiry of a setpoint, as the application asked for it."""

Setpoint: TypeAlias = SetWheelVelocity | SetDuty

SETPOINT_IDS = frozenset({message_id(SetWheelVelocity), message_id(SetDuty)})

Unseen: TypeAlias = tuple[Setpoint, int, int]
"""Sent, and no state frame has shown yet that the device obeys it: the setpoint, when it expires on
the host's clock, and when it is to be repeated."""

_DEFAULT_GAPS_US = {one.id: round(one.default * 1e6) for one in (REARM_GAP, TTL_MAX)}
_ESTOPPED, _FAULT = SupervisorState.ESTOPPED, SupervisorState.FAULT
_LATCHED = {
    SupervisorState.ESTOPPED: RefusalCode.ESTOPPED,
    SupervisorState.FAULT: RefusalCode.FAULT,
}


class OpenSession(NamedTuple):
    """What a setpoint needs of an open session."""

    id: int
    clock: ClockEstimator
    command_seqs: count[int]
    """Shared by setpoints and stops: a stop's number is higher than all earlier setpoints'."""
    encoder: Encoder


class SetpointPort(Protocol):
    """Where a link writes setpoints. Each looks at attributes: a method would be a call."""

    @property
    def clock_ns(self) -> Callable[[], int]:
        """The host's time of the link."""

    @property
    def output(self) -> bytes:
        """What waits for the port."""

    @property
    def frames(self) -> Collection[bytes]:
        """The setpoints that wait behind it."""

    def check_room(self) -> None:
        """Raise `LinkLost` if a setpoint could not be written soon. Called if something waits."""

    def send(self, frame: bytes, now_us: int) -> None:
        """Write a frame in the calling thread; `LinkLost` if the port is gone."""


class SetpointSender:
    """Sends a link's setpoints, and repeats them. The latest wins.

    Args:
        send: Takes a message for the line: the repeats.
        trial: The trial of parameters; no setpoint goes out once it is lost.
        why_closed: Returns the error that says why no session is open.
        traffic: Passes on what is asked for.
        warn: Takes what the user should know, as `logging.warning` does.

    Attributes:
        opened: The open session; None while there is none. Replaced as a whole.
        repeated: How many were sent again.
        expired: How many the device refused because they came too late.
        supervisor: The newest known; None when it is about to change, or no session is open.
        faults: The newest known to be latched.
        refused_us: When the last refusal came.
        moves_until_us: When the last setpoint that may move the device expires; 0: it was stopped.
        newest: The newest setpoint, and when it expires on the host's clock; None after a stop.
        zero_seq: Number of the newest setpoint of this session that asked for standstill.
        unseen: The newest setpoint, until a state frame shows what became of it.
        awaits_fate: Whether somebody waits for what becomes of a setpoint.
        port: Set by a link that drives.
    """

    port: SetpointPort

    def __init__(
        self,
        send: Callable[[AnyMessage], None],
        trial: HeldTrial,
        why_closed: Callable[[], WheelwireError],
        traffic: Traffic,
        warn: Callable[..., None],
    ) -> None:
        self.opened: OpenSession | None = None
        self.repeated = 0
        self.expired = 0
        self.supervisor: SupervisorState | None = None
        self.faults = NO_FAULT
        self.refused_us = 0
        self.moves_until_us = 0
        self.newest: tuple[Setpoint, int] | None = None
        self._send = send
        self._trial = trial
        self._why_closed = why_closed
        self._traffic = traffic
        self._warn = warn
        self._gaps_us = _DEFAULT_GAPS_US
        self._quiet_since_us: int | None = None
        """Since when no motion was asked for, while setpoints are held; else None."""
        self._unarmed_seq: int | None = None
        """The newest setpoint that was known when one was refused as unarmed; None once the device
        obeys a newer one, or the pause is over."""
        self._refusal: int | None = None
        self.zero_seq = 0
        self.awaits_fate = False
        self._obeyed_seq = 0
        self._late = 0
        """How many in a row came too late; `LATE`, and no more, once the log has it."""
        self._refused: tuple[int, int] | None = None
        """Number of the newest setpoint that the device refused, and why."""
        self.unseen: Unseen | None = None

    @property
    def repeat_due_us(self) -> int | None:
        """When `advance` has something to do."""
        unseen = self.unseen
        return None if unseen is None else unseen[2]

    def end_session(self) -> None:
        """The session is over: nothing can be sent, and what is known of the device is void."""
        # First, so that no other thread begins a frame of this session.
        self.opened = None
        self.clear()
        self.zero_seq = self._obeyed_seq = self._late = 0
        self._refused = None
        if self._unarmed_seq is not None:
            self._unarmed_seq = 0  # numbers restart
        self._gaps_us = _DEFAULT_GAPS_US

    def take_gap(self, parameter: int, value_s: float) -> None:
        """What the device says of one of the parameters `REARM_GAP` and `TTL_MAX`."""
        self._gaps_us = {**self._gaps_us, parameter: round(value_s * 1e6)}

    @property
    def gap_us(self) -> int:
        """The pause after which a robot that is unarmed drives again, as far as known."""
        return max(self._gaps_us.values())

    @property
    def is_unarmed(self) -> bool:
        """Whether setpoints are refused until a zero one, or a pause. Known once one was."""
        return self._unarmed_seq is not None

    def hold(self, now_us: int) -> None:
        """The device has restarted: send no motion before a zero setpoint or a pause.

        The device does the same after its start. But a program that kept asking for motion was
        refused here until the session was open, which may have taken longer than that pause.
        """
        self._quiet_since_us = now_us

    def open(self, opened: OpenSession, now_us: int) -> None:
        """A session is open."""
        if self._quiet_since_us is not None:
            self._quiet_since_us = now_us  # no program could ask before
        self.opened = opened

    @property
    def held(self) -> tuple[int | None, int | None]:
        """What a session that goes on from this one's state needs of `hold` and `is_unarmed`."""
        return self._quiet_since_us, self._unarmed_seq

    @held.setter
    def held(self, known: tuple[int | None, int | None]) -> None:
        self._quiet_since_us, self._unarmed_seq = known

    def clear(self) -> None:
        """What was refused or latched is past, and what was sent is void."""
        self.on_stop()
        self.supervisor = None
        self.faults = NO_FAULT

    def void(self) -> None:
        """What was sent is not to be sent again."""
        self.unseen = None
        self.newest = None

    def on_stop(self) -> None:
        """A stop goes out: what was sent before it, or refused, is past.

        What is latched stays known: the copy of an e-stop that its caller wrote may have latched
        the device already.
        """
        self.void()
        self._refusal = None

    def drive(self, kind: type[Setpoint], left: float, right: float, expiry_us: int) -> None:
        """Write a setpoint at once; as `frame`.

        Raises:
            LinkLost: The session is not open, or the port takes nothing.
            WheelwireError: As `frame`.
        """
        port = self.port
        now_us = port.clock_ns() // 1000
        # Before a frame is made, which would be recorded for a repeat and so be sent after all.
        if port.output or port.frames:
            port.check_room()
        port.send(self.frame(kind, left, right, expiry_us, now_us), now_us)

    def frame(
        self, kind: type[Setpoint], left: float, right: float, expiry_us: int, now_us: int
    ) -> bytes:
        """Encode a setpoint; from any thread.

        Args:
            kind: Of the message.
            left: Velocity [m/s] at the rim, or duty, -1..1.
            right: The same.
            expiry_us: When it expires, on the host's clock.
            now_us: The host's clock.

        Returns:
            Its frame, to be written at once.

        Raises:
            Expired: It expires within the error bound of the device's clock.
            LinkLost: The session is not open.
            DeviceRefused: The last setpoint was refused for another reason than its age, an e-stop
                or a fault is latched, or a trial of parameters was lost. After UNARMED zero is
                sent, and does not raise.
        """
        if self._traffic.readers:
            what = Kind.DUTY if kind is SetDuty else Kind.VELOCITY
            self._traffic.put(what, now_us, ASKED.pack(left, right, expiry_us))
        if kind is SetDuty:
            left, right = round(left * DUTY_SCALE), round(right * DUTY_SCALE)
        opened = self.opened
        if opened is None:  # read once: the port's thread may end the session at any time
            raise afresh(self._why_closed())
        if self._trial.held is not None:
            self._trial.check("the setpoint")
        # By identity: a dictionary lookup would hash the state, in Python code.
        state = self.supervisor
        is_unarmed = False
        if self._refusal is not None or state is _ESTOPPED or state is _FAULT:
            is_unarmed = self._take_unarmed(is_zero=not (left or right), now_us=now_us)
            self.check()
        # The device's clock is known only within a bound. Subtract the bound from the expiry, or
        # the setpoint could live longer than its ttl.
        device_expiry_us, error_us = opened.clock.conversion.host_to_device(expiry_us)
        bound_us = math.ceil(error_us)
        sure_us = expiry_us - bound_us
        if sure_us <= now_us:
            raise Expired(
                f"{(expiry_us - now_us) / 1e3:g} ms are left of the setpoint's ttl, and the "
                f"device's clock is known to {bound_us / 1e3:g} ms: give it a longer ttl"
            )
        if self._quiet_since_us is not None:
            self._end_hold(is_zero=not (left or right), now_us=now_us)
        # Two threads never get the same number: next() of a count is atomic in CPython.
        command_seq = next(opened.command_seqs)
        fields = opened.id, command_seq, device_expiry_us - bound_us, left, right
        setpoint = tuple.__new__(kind, fields)  # as `kind`, without its call
        if not (left or right):
            self.zero_seq = command_seq
        if is_unarmed:
            # Sent even so. The device would take silence for a pause and then drive, although the
            # caller never stopped asking for motion.
            self.unseen = setpoint, sure_us, now_us
            raise DeviceRefused(RefusalCode.UNARMED, "the setpoint")
        self.moves_until_us = sure_us if left or right else 0
        # Before it is written: the state frame that shows it may come at any moment after.
        self.unseen = setpoint, sure_us, now_us + REPEAT_AFTER_US
        self.newest = setpoint, sure_us
        return opened.encoder.encode(setpoint)

    def stop_copy(self, mode: StopMode | None) -> bytes | None:
        """A frame that stops at once, or with None latches, sent as well as the acknowledged stop.

        From any thread; to be written at once. None if no session is open.
        """
        # Read once: the port's thread may end the session at any time.
        opened = self.opened
        if opened is None:
            return None
        self._traffic.put(
            Kind.STOP_COPY, self._traffic.host_us, bytes([ESTOP if mode is None else mode])
        )
        if mode is None:
            return opened.encoder.encode(Estop(opened.id, COPY_ID))
        command_seq = next(opened.command_seqs)
        return opened.encoder.encode(Stop(opened.id, COPY_ID, command_seq, mode))

    def check(self) -> None:
        """Find out before sending that the device will not drive.

        Raises:
            DeviceRefused: The last setpoint was refused (reported once), or the device is latched.
        """
        # Reported once, or one setpoint that was refused would hold back all that follow.
        refusal, self._refusal = self._refusal, None
        if refusal is None and self.supervisor is not None:
            refusal = _LATCHED.get(self.supervisor)
        if refusal is not None:
            faults = self.faults if refusal == RefusalCode.FAULT else NO_FAULT
            raise DeviceRefused(refusal, "the setpoint", faults)

    def advance(self, now_us: int) -> None:
        """Repeat an unseen setpoint, with the same number and expiry, while it is valid."""
        # Read once: another thread may replace it at any time.
        unseen = self.unseen
        if unseen is None or now_us < unseen[2]:
            return
        setpoint, expiry_host_us, _ = unseen
        # An expired one would only be refused.
        if now_us < expiry_host_us:
            self.repeated += 1
            self._send(setpoint)
        self._forget(unseen)

    def has_fate(self, command_seq: int) -> bool:
        """Whether the device has obeyed or refused this setpoint."""
        return self._obeyed_seq == command_seq or self.refusal_of(command_seq) is not None

    def refusal_of(self, command_seq: int) -> int | None:
        """Why the device refused this setpoint, if it was the last one that it refused."""
        refused = self._refused
        return refused[1] if refused is not None and refused[0] == command_seq else None

    def on_obeyed(self, command_seq: int, now_us: int) -> None:
        """The device says which setpoint it obeys."""
        if command_seq != self._obeyed_seq and self._late < LATE:
            self._late = 0
        self._obeyed_seq = command_seq
        if self._unarmed_seq is not None and (
            command_seq > self._unarmed_seq or self._has_paused(now_us)
        ):
            self._unarmed_seq = None
        if self.unseen is not None:
            self._note_arrived(command_seq)

    def on_held(self, held: Held) -> None:
        """The device says what holds it: not what is held here, for it was not asked."""
        if not held & UNARMED and self._quiet_since_us is None:
            self._unarmed_seq = None

    def _note_arrived(self, command_seq: int) -> None:
        unseen = self.unseen
        # An older one says nothing about the newest, which may be lost.
        if unseen is not None and unseen[0].command_seq == command_seq:
            self._forget(unseen)

    def on_refused(self, refuse: Refuse) -> None:
        """The device refused one."""
        if refuse.code == RefusalCode.EXPIRED:
            self.expired += 1  # the next one may be in time: do not hold it back
            if self.refusal_of(refuse.reference) is None:  # its repeat is refused, too
                self._note_late()
        else:
            self._refusal = refuse.code
        self._refused = refuse.reference, refuse.code
        # It arrived, so it is not sent again.
        self._note_arrived(refuse.reference)
        # The zero that was sent since has armed the device, or is refused as well.
        if refuse.code == RefusalCode.UNARMED:
            if refuse.reference < self.zero_seq:
                self._refusal = None
            else:
                self._note_unarmed(refuse.reference)

    def _note_late(self) -> None:
        """One came too late; say so once a session if none comes in time."""
        if self._late < LATE:
            self._late += 1
            if self._late == LATE:
                self._warn(ALL_LATE)

    def _take_unarmed(self, *, is_zero: bool, now_us: int) -> bool:
        """Whether a setpoint has to raise that the device is unarmed, which is reported once."""
        if self._refusal != RefusalCode.UNARMED:
            return False
        self._refusal = None
        # Zero is what the device waits for, and so is a pause.
        return not is_zero and now_us - self.refused_us < self.gap_us

    def _end_hold(self, *, is_zero: bool, now_us: int) -> None:
        """End it by a zero setpoint or a pause; raises `DeviceRefused` for anything else."""
        since_us = self._quiet_since_us
        if since_us is None or is_zero or now_us - since_us >= self.gap_us:
            self._quiet_since_us = None
            return
        self._quiet_since_us = now_us
        self._note_unarmed(0)
        raise DeviceRefused(RefusalCode.UNARMED, "the setpoint")

    def _has_paused(self, now_us: int) -> bool:
        """Whether no motion was asked for long enough to end what is held here."""
        since_us = self._quiet_since_us
        return since_us is not None and now_us - since_us >= self.gap_us

    def _note_unarmed(self, command_seq: int) -> None:
        """A setpoint was refused; report it once, not again at each of the next ones."""
        was_unarmed, self._unarmed_seq = self.is_unarmed, command_seq
        if not was_unarmed:
            self._warn(HELD, self.gap_us / 1e6)

    def _forget(self, unseen: Unseen) -> None:
        # Another thread may just have sent the next one. Between these two lines its repeat can
        # still be lost; a good line does not need it.
        if self.unseen is unseen:
            self.unseen = None
