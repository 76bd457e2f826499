"""Finds the stops in a link's records, and each one's cause."""

from __future__ import annotations

from bisect import insort
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import NamedTuple

from wheelwire_protocol import types as wire
from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import (
    EstopSource,
    EventCode,
    Fault,
    Held,
    RefusalCode,
    ResetReason,
    StopCause,
    SupervisorEvent,
    SupervisorState,
)
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from ...link.port_loop import CLOSED
from ...link.sample_stream import Measurement
from ...link.session import Phase, Session
from ...link.setpoints import SETPOINT_IDS
from ...link.traffic import Kind, Record
from ...samples import TICK_MODULUS, tick_difference
from ..rerun import FrameReader, Rerun
from . import wheel_fault
from .causes import (
    COUNTING_FAULTS,
    ESTOPS,
    LATCHED,
    OTHER_FAULTS,
    REFUSALS,
    RESETS,
    WHEEL_FAULTS,
    channel_of,
    look_at_of,
    sensed_causes,
    sentence_of,
)
from .history import SPAN_US, Asked, History, battery_v, drives

DECIDE_US = 60_000
"""A stop is judged this long after it, for later records may explain it."""
HOLD_US = 200_000
"""The device reports within this time what latched an e-stop, and which sensor stopped it."""
INPUTS_US = 1_200_000
"""A stop by a sensor is judged this long after it, unless the device has named the sensor sooner.

The device repeats its inputs once a second, in case the line has lost them.
"""
ANSWER_US = 500_000
"""A message that was sent this long ago may be the cause."""
RESTART_US = 5_000_000
"""A Restart that was sent this long before a start may be its cause."""
EXPIRY_US = 30_000
"""A setpoint that ends this near to a deadline is the one that ran out."""
RESUMES_US = 500_000
"""Setpoints may come again within this time, and then show how far apart they are."""
FROZEN_S = 0.4
"""A link that waits wakes up twice as often as this."""
MOVING_MPS = 0.02
STANDING_MPS = 0.005
LASTING = (
    Fault.DRIVER_FAILED
    | Fault.STORE_FULL
    | Fault.STORE_NEWER
    | Fault.STORE_UNREADABLE
    | Fault.STORE_OUTDATED
    | Fault.NO_BOARD
)
"""Faults that each start finds again."""
SAG_V = 0.3
EMPTY_V = 0.3
EMPTY_S = 60.0
LOW_PART = 0.87
"""A battery with less than this part of nominal_supply_v at rest is low: 6.4 V of 7.4 V."""
SAGS_PART = 0.1
"""A supply that loses more than this part of its voltage under load is too weak."""

_NOMINAL_SUPPLY = PARAMETER_BY_NAME["nominal_supply_v"].id
_DRIVING = SupervisorState.DRIVING


@dataclass(frozen=True)
class Stop:
    """A stop, and why.

    Attributes:
        host_us: When, on the host's monotonic clock.
        cause: Its name in `CAUSES`; where the data cannot decide, those that are left, joined by
            " or ".
        sentence: What happened.
        evidence: What shows it.
        look_at: What to look at first.
    """

    host_us: int
    cause: str
    sentence: str
    evidence: tuple[str, ...]
    look_at: str

    @property
    def causes(self) -> tuple[str, ...]:
        """The names one by one."""
        return tuple(self.cause.split(" or "))


class _Loss(NamedTuple):
    """The robot went out of reach while it drove."""

    host_us: int
    text: str
    by_port: bool
    """The system reported that the port is gone."""


class Diagnosis:
    """Runs a session again, and reports its stops.

    Live, it reports a stop some 60 ms later, with the records that come then. An expired setpoint
    takes 0.5 s, because the next ones may explain it. A sensor takes up to 1.2 s, until the device
    has said which one.

    Attributes:
        latched_before: The state and faults that were latched before the first record, by name.
        has_heard: Whether the robot was ever in reach.
    """

    def __init__(self) -> None:
        self.latched_before: tuple[str, ...] = ()
        self.has_heard = False
        self._rerun = Rerun()
        self._frames = FrameReader()
        self._history = History()
        self._undecided: list[tuple[int, Callable[[], Stop | None]]] = []
        """When to judge each stop, and how; in order."""
        self._latch: Callable[[], Stop | None] | None = None
        """Judges the stop that latches the robot now; once reported, it is that."""
        self._paused: Callable[[], Stop | None] | None = None
        """Judges a setpoint that ran out, once the next ones have had time to come."""
        self._by_sensor: tuple[Callable[[], Stop | None], int] | None = None
        """Judges the newest stop by a sensor, and when that was."""
        self._state: SupervisorState | None = None
        self._state_t_us: int | None = None
        self._faults = Fault(0)
        self._boot_id: int | None = None
        self._loss: _Loss | None = None
        self._moved = False
        self._refused: set[tuple[int, int]] = set()
        self._trial_us = -ANSWER_US
        self._hold: wire.Hold | None = None
        """What the device said last of what holds it, and when that came."""
        self._hold_us = 0
        self._latched_us = 0
        self._strangers: deque[tuple[int, int]] = deque(maxlen=16)
        """Answers to other programs: their time and the message that they answer."""
        self._contact_seen_us = -ANSWER_US
        self._nominal_v: float | None = None
        self._hung_up = False
        self._too_slow_us = -SPAN_US
        """When a setpoint last ran out because the program asks too seldom."""
        self._last_stop_us = -2 * ANSWER_US
        self._last_cause = ""

    # --- records in, stops out -------------------------------------------------------------------

    def feed(self, record: Record) -> list[Stop]:
        """Take one record; returns the stops that this decides.

        Raises:
            ValueError: The record is from another release.
        """
        stops = self._decide(record.host_us)
        session = self._rerun.session
        phase = session.phase if session is not None else Phase.CLOSED
        self._history.note(record)
        for frame in self._frames.feed(record):
            if frame.is_sent:
                self._history.sent.append((frame.host_us, frame.message))
            else:
                self._take(frame.message, frame.host_us)
        for measurement in self._rerun.feed(record):
            self._take_sample(measurement)
        session = self._rerun.session
        if session is not None:
            self.has_heard |= session.phase is Phase.OPEN
            self._history.note_sensors(session.sensors, record.host_us)
            if record.kind is Kind.START:
                self._begin(session)
            else:
                self._follow(session, phase, record)
        return stops

    def feed_all(self, records: Iterable[Record]) -> list[Stop]:
        """As `feed`, one after the other."""
        return [stop for record in records for stop in self.feed(record)]

    def end(self, *, complete: bool) -> list[Stop]:
        """The records have ended; returns the remaining stops.

        Args:
            complete: The recorder closed the recording, or is still recording; False: it was cut
                off.
        """
        self._by_sensor = None  # nothing more will name it
        stops = self._decide(self._rerun.host_us + 2 * ANSWER_US)
        now_us = self._rerun.host_us
        if self._loss is not None:
            stops.append(self._lost(self._loss))
        elif self._state is _DRIVING and (self._hung_up or not complete):
            causes: tuple[str, ...] = ("host_hung_up",)
            text = "the link was closed while a setpoint was obeyed"
            if not self._hung_up:
                causes = "host_killed", "recording_cut"
                text = "the recording ends without a close while the robot drove"
            elif now_us - self._history.stop_us < ANSWER_US:
                causes, text = ("stop_by_session",), "it closed the robot, which stops it"
            stops.append(self._stop(now_us, causes, (text,)))
        return stops

    def latched(self) -> Stop | None:
        """The stop that latches the robot now, judged by what is known by now."""
        return self._latch() if self._latch is not None else None

    def _decide(self, now_us: int) -> list[Stop]:
        stops: list[Stop | None] = []
        while self._undecided and self._undecided[0][0] <= now_us:
            due_us, judge = self._undecided.pop(0)
            if self._waits_for_inputs(judge, now_us):
                self._later(due_us, judge)
                continue
            paused, self._paused = self._paused, None
            if paused is not None and paused is not judge:  # first: stops are reported in order
                self._undecided = [one for one in self._undecided if one[1] is not paused]
                stops.append(paused())
            stops.append(judge())
            if judge is self._latch:
                self._latch = partial(_same, stops[-1])
        return [stop for stop in stops if stop is not None]

    def _waits_for_inputs(self, judge: Callable[[], Stop | None], now_us: int) -> bool:
        """Whether it judges a stop whose cause the device may still report."""
        session, stopped, hold_us = self._rerun.session, self._by_sensor, self._hold_us
        if session is None:
            return False
        is_unsaid = self._hold is not None and hold_us < self._latched_us
        if judge is self._latch and is_unsaid and now_us < self._latched_us + HOLD_US:
            return True
        if stopped is None or judge is not stopped[0]:
            return False
        is_asked = session.phase is Phase.OPEN and session.sensors.rate_hz > 0
        # By name; the report of what holds the robot does not have it.
        is_known = bool(self._history.stopping_sensors(stopped[1]))
        return is_asked and not is_known and now_us < stopped[1] + INPUTS_US

    def _later(
        self, host_us: int, judge: Callable[[], Stop | None], wait_us: int = DECIDE_US
    ) -> None:
        insort(self._undecided, (host_us + wait_us, judge), key=itemgetter(0))

    def _stop(
        self, host_us: int, causes: tuple[str, ...], evidence: Iterable[str], side: str = ""
    ) -> Stop:
        self._last_stop_us, self._last_cause = host_us, causes[0]
        return stop_of(host_us, causes, evidence, side)

    # --- how it is now ---------------------------------------------------------------------------

    def _begin(self, session: Session) -> None:
        if session.phase is Phase.OPEN:
            self._state = session.setpoints.supervisor
            self._faults = session.setpoints.faults
            if self._state in (SupervisorState.FAULT, SupervisorState.ESTOPPED):
                faults = (str(one.name) for one in Fault if one in self._faults)
                self.latched_before = self._state.name, *faults
        self._nominal_v = session.reported.values.get(_NOMINAL_SUPPLY)
        self._hold = session.reported.hold
        if session.device is not None:
            self._boot_id = session.device.boot_id

    def _follow(self, session: Session, phase: Phase, record: Record) -> None:
        """Take the changes that one record made to the session."""
        if phase is Phase.OPEN and session.phase is not Phase.OPEN:
            by_port = record.kind is Kind.DISCONNECTED
            self._hung_up = by_port and record.data == CLOSED.encode()
            if self._state is _DRIVING and not self._hung_up:
                self._loss = _Loss(record.host_us, str(session.error), by_port)
        if self._loss is not None and self._state is not _DRIVING:
            self._loss = None  # the device itself has said why it stopped

    def _take_sample(self, measurement: Measurement) -> None:
        self.has_heard = True
        self._history.note_sample(measurement)
        state, t_us = measurement.supervisor, measurement.state.t_us
        if self._state_t_us is not None and tick_difference(t_us, self._state_t_us) < 0:
            return  # measured before what an event has said
        # Later samples are newer, too: after half an hour 32 bits of time could not tell.
        self._state_t_us = None
        at_us = measurement.arrived_us
        self._change(self._state, state, measurement.faults, at_us, at_us)
        self._faults = measurement.faults
        self._look_for_rest(measurement)

    def _look_for_rest(self, measurement: Measurement) -> None:
        """Whether the wheels came to rest because zero was asked for."""
        speed = max(abs(measurement.state.left_mps), abs(measurement.state.right_mps))
        if speed > MOVING_MPS:
            self._moved = True
        elif self._moved and speed < STANDING_MPS:
            self._moved = False
            asked, at_us = self._history.asked, measurement.arrived_us
            is_zero = bool(asked) and asked[-1].left == asked[-1].right == 0.0
            if measurement.supervisor is _DRIVING and is_zero:
                text = "the newest setpoint is zero, and the robot obeys it"
                self._later(at_us, partial(self._stop, at_us, ("zero_setpoint",), (text,)))

    # --- messages --------------------------------------------------------------------------------

    def _take(self, message: wire.AnyMessage, now_us: int) -> None:
        if isinstance(message, wire.Event):
            self._take_event(message, now_us)
        elif isinstance(message, wire.Hold):
            self._take_hold(message, now_us)
        elif isinstance(message, wire.DeviceHello):
            self._take_hello(message, now_us)
        elif isinstance(message, wire.Refuse):
            self._take_refusal(message, now_us)
        elif isinstance(message, (wire.ParameterValue, wire.ParameterEntry)):
            if message.parameter == _NOMINAL_SUPPLY:
                self._nominal_v = message.value
        elif isinstance(message, wire.Ack):
            session = self._rerun.session
            if session is not None and message.session_id != session.id:
                self._strangers.append((now_us, message.message_id))

    def _take_event(self, event: wire.Event, now_us: int) -> None:
        if self._boot_id is not None and event.boot_id != self._boot_id:
            return
        if event.code == EventCode.TRIAL_EXPIRED:
            self._trial_us = now_us
        if event.code != EventCode.SUPERVISOR:
            return
        try:
            before, after = SupervisorState(event.before), SupervisorState(event.after)
            cause, faults = SupervisorEvent(event.cause), Fault(event.faults)
        except ValueError:
            return
        at_us = self._history.host_us(event.t_us) or now_us
        self._change(before, after, faults, at_us, now_us, cause)
        self._state_t_us = event.t_us
        self._faults = faults

    def _take_hold(self, hold: wire.Hold, now_us: int) -> None:
        """The device has said what holds it; one that a bumper holds off changes no state."""
        before, self._hold, self._hold_us = self._hold, hold, now_us
        is_new = before is not None and hold.stop_us != before.stop_us
        if is_new and hold.stop_cause == StopCause.BUMPER:
            at_us = self._history.host_us(hold.stop_us % TICK_MODULUS) or now_us
            self._later(now_us, partial(self._held_off, at_us, hold), 0)

    def _held_off(self, at_us: int, hold: wire.Hold) -> Stop:
        sensors = [flag for flag in Held if hold.stop_held & flag]
        evidence = [f"{flag.name}: {flag.doc}" for flag in sensors]
        evidence.append(f"it went at {hold.stop_mmps / 1000:.2f} m/s")
        channel = channel_of(sensors[0]) if sensors else "A bumper"
        return self._stop(at_us, ("bumper_pressed",), evidence, channel)

    def _change(
        self,
        before: SupervisorState | None,
        after: SupervisorState,
        faults: Fault,
        at_us: int,
        now_us: int,
        cause: SupervisorEvent | None = None,
    ) -> None:
        """The supervisor's state has changed, by an event or, if that was lost, by a sample."""
        known, self._state = self._state, after
        if known is after:
            return
        first = known is None
        judge: Callable[[], Stop | None] | None = None
        self._latch = None
        if after is SupervisorState.FAULT:
            new = faults & ~self._faults if not first else faults
            samples = tuple(self._history.samples)
            judge = self._latch = partial(self._fault, at_us, new or faults, samples, first)
            if Fault.EXTERNAL in (new or faults) and not first:
                self._by_sensor = judge, at_us
            self._latched_us = at_us
        elif after is SupervisorState.ESTOPPED:
            judge = self._latch = partial(self._estopped, at_us, first)
            self._latched_us = at_us
        elif before is _DRIVING and after is SupervisorState.TIMED_OUT:
            judge = partial(self._timed_out, at_us)
        elif before is _DRIVING and after is SupervisorState.IDLE:
            if cause is SupervisorEvent.SESSION:
                judge = partial(self._new_session, at_us)
            else:
                judge = partial(self._asked_to_stop, at_us)
        if judge is not None:
            self._later(now_us, judge)

    def _take_hello(self, hello: wire.DeviceHello, now_us: int) -> None:
        if hello.refusal:
            self._refuse(hello.refusal, now_us, "the device refused the hello")
            return
        before, self._boot_id = self._boot_id, hello.boot_id
        loss, self._loss = self._loss, None
        if before is None or before == hello.boot_id:
            if loss is not None:
                self._later(now_us, partial(self._back, loss, now_us))
                self._state = SupervisorState.TIMED_OUT
            return
        try:
            reason = ResetReason(hello.reset_reason)
        except ValueError:
            reason = ResetReason.UNKNOWN
        at_us = loss.host_us if loss is not None else now_us
        asked = self._history.was_sent(wire.Restart, now_us - RESTART_US)
        samples = tuple(self._history.samples)
        self._later(now_us, partial(self._reset, at_us, reason, samples, asked=asked))
        self._history.begin_boot()
        self._state, self._state_t_us, self._faults, self._latch = None, None, Fault(0), None
        self._refused.clear()

    def _take_refusal(self, refuse: wire.Refuse, now_us: int) -> None:
        try:
            code = RefusalCode(refuse.code)
        except ValueError:
            return
        if code is RefusalCode.CAUSE_PRESENT and refuse.message_id == message_id(wire.ClearEstop):
            self._contact_seen_us = now_us
        if refuse.message_id not in SETPOINT_IDS:
            return
        self._history.refusals.append((now_us, refuse))
        if self._state is not _DRIVING and code not in LATCHED:
            self._refuse(code, now_us, "a setpoint was refused")

    def _refuse(self, number: int, now_us: int, what: str) -> None:
        """Report each refusal that keeps the robot from driving once a session."""
        session = self._rerun.session
        key = (session.count if session is not None else 0, number)
        if key in self._refused or number not in REFUSALS:
            return  # also if it is one of a later release
        code = RefusalCode(number)
        self._refused.add(key)
        evidence = (f"{what}: {code.name}. {code.doc}",)
        # A reset explains it, but shows only when the next session begins.
        wait_us = 2 * ANSWER_US if code is RefusalCode.NO_SESSION else DECIDE_US
        self._later(now_us, partial(self._never_drove, now_us, code, evidence), wait_us)

    def _never_drove(
        self, now_us: int, code: RefusalCode, evidence: tuple[str, ...]
    ) -> Stop | None:
        # What has just stopped the robot explains them.
        cause = REFUSALS[code]
        is_explained = code is RefusalCode.NO_SESSION or cause == self._last_cause
        if is_explained and abs(now_us - self._last_stop_us) < 2 * ANSWER_US:
            return None
        return self._stop(now_us, (cause,), evidence)

    # --- causes ----------------------------------------------------------------------------------

    def _fault(
        self, at_us: int, faults: Fault, samples: tuple[Measurement, ...], first: bool
    ) -> Stop:
        names = ", ".join(str(one.name) for one in Fault if one in faults)
        if Fault.EXTERNAL in faults and not first:
            return self._stopped_by_sensor(at_us, faults)
        for one, name in OTHER_FAULTS.items():
            if one in faults and (not first or one in LASTING):
                return self._stop(at_us, (name,), (f"{names}: {one.doc}", *supply_fall(samples)))
        if first:
            return self._stop(at_us, ("fault_before_reset",), (names,))
        for one, (side, name) in WHEEL_FAULTS.items():
            if one in faults:
                return self._wheel_fault(at_us, one, side, name, samples)
        return self._stop(at_us, ("external_fault",), (names,))

    def _stopped_by_sensor(self, at_us: int, faults: Fault) -> Stop:
        """An input, the battery or a stale sensor stopped the robot."""
        evidence = [f"{one.name}: {one.doc}" for one in Fault if one in faults]
        found = self._history.stopping_sensors(at_us)
        if not found and self._hold is not None and self._hold_us >= at_us:
            found = sensed_causes(Held(self._hold.stop_held | self._hold.held))
        if not found:
            evidence.append("the sensors' samples were not requested, or not received")
            return self._stop(at_us, ("external_fault",), evidence)
        channel, cause = next(iter(found.items()))
        evidence += [sentence_of((other,), name) for name, other in found.items()]
        return self._stop(at_us, (cause,), evidence, channel)

    def _wheel_fault(
        self, at_us: int, fault: Fault, side: str, name: str, samples: tuple[Measurement, ...]
    ) -> Stop:
        causes: tuple[str, ...] = (name,)
        evidence: tuple[str, ...] = (str(fault.name),)
        if name != "wheel_reversed":
            causes, found = wheel_fault.examine(samples, side, counting=not fault & COUNTING_FAULTS)
            evidence = (*evidence, *found)
        return self._stop(at_us, causes, (*evidence, *supply_fall(samples)), side)

    def _estopped(self, at_us: int, first: bool) -> Stop:
        asked = self._who_asked(at_us, wire.Estop)
        if asked:
            return self._stop(at_us, ("estop_by_session",), asked)
        if first:
            return self._stop(
                at_us, ("estop_before_reset",), ("ESTOPPED from the start of the session",)
            )
        if self._is_answered(wire.Estop, at_us):
            text = "the device acknowledged an Estop that another program had sent"
            return self._stop(at_us, ("estop_by_stranger",), (text,))
        source = self._estop_source(at_us)
        if source in ESTOPS:
            return self._stop(at_us, (ESTOPS[source],), (f"the device says: {source.doc}",))
        evidence = ["no Estop was sent over this link"]
        if self._contact_seen_us >= at_us:
            evidence.append("a clear was refused: the contact is still open")
            return self._stop(at_us, ("contact_open",), evidence)
        evidence.append("whether the contact opened or another program asked is not in the data")
        return self._stop(at_us, ("contact_open", "estop_by_stranger"), evidence)

    def _estop_source(self, at_us: int) -> EstopSource:
        """What latched that e-stop, if the device has said so.

        At the start of a session it says so before the first sample shows the e-stop.
        """
        hold = self._hold
        if hold is None or self._hold_us < at_us - ANSWER_US or not hold.held & Held.ESTOP:
            return EstopSource.NONE
        return EstopSource(hold.estop_source)

    def _asked_to_stop(self, at_us: int) -> Stop:
        if abs(self._trial_us - at_us) < ANSWER_US:
            self._trial_us = -ANSWER_US  # it explains no later stop
            return self._stop(at_us, ("trial_expired",), ("the device reported it",))
        asked = self._who_asked(at_us, wire.Stop)
        if asked:
            return self._stop(at_us, ("stop_by_session",), asked)
        evidence = ["no Stop was sent over this link"]
        if self._is_answered(wire.Stop, at_us):
            evidence.append("the device acknowledged one of another program")
        return self._stop(at_us, ("stop_by_stranger",), evidence)

    def _who_asked(self, at_us: int, kind: type[wire.AnyMessage]) -> tuple[str, ...]:
        """Evidence that this link asked for the stop; empty if it did not."""
        sent = self._history.stops_by(kind, at_us, ANSWER_US)
        if not sent:
            return ()
        by = self._history.who_asked(kind, sent)
        return f"the message {kind.__name__} was sent just before", by

    def _is_answered(self, kind: type[wire.AnyMessage], at_us: int) -> bool:
        asked = message_id(kind)
        before_us = self._history.explained_us(asked, at_us) + DECIDE_US
        is_answered = any(
            answered == asked and abs(when - at_us) < ANSWER_US and when > before_us
            for when, answered in self._strangers
        )
        if is_answered:
            self._history.note_explained(asked, at_us)
        return is_answered

    def _new_session(self, at_us: int) -> Stop:
        if self._history.was_sent(wire.Hello, at_us - ANSWER_US):
            error = self._rerun.session.error if self._rerun.session is not None else ""
            gap_s = self._history.longest_gap_s(at_us - 2 * ANSWER_US)
            cause = (
                "host_frozen" if gap_s > FROZEN_S or "suspended" in str(error) else "cable_pulled"
            )
            return self._stop(at_us, (cause,), (f"this program opened a new session: {error}",))
        text = "the device began a session that this program did not ask for"
        return self._stop(at_us, ("new_session",), (text,))

    def _timed_out(self, at_us: int) -> Stop | None:
        """A setpoint ran out; None if what follows has to show why."""
        history = self._history
        asked = [one for one in history.asked if one.host_us <= at_us]
        if not asked:
            return self._stop(at_us, ("program_paused",), ("no setpoint was sent",))
        last = asked[-1]
        quiet_s = (at_us - last.host_us) / 1e6
        if last.expiry_us > at_us + EXPIRY_US:
            return self._unobeyed(at_us, asked)
        gap_s = history.gap_over_s(at_us, EXPIRY_US)
        evidence = [f"the last setpoint was sent {quiet_s:.2f} s before"]
        if gap_s >= 0.5 * quiet_s:
            evidence.append(f"for {gap_s:.2f} s the program did not run")
            evidence.append("then it read at once what the robot had sent meanwhile")
            return self._stop(at_us, ("host_frozen",), evidence)
        states = sum(1 for one in history.samples if last.host_us < one.arrived_us <= at_us)
        evidence.append(f"{states} samples were received since")
        self._paused = partial(self._asked_late, at_us, last, evidence)
        self._later(at_us, self._paused, RESUMES_US)
        return None

    def _asked_late(self, at_us: int, last: Asked, evidence: list[str]) -> Stop | None:
        """The program paused, or asks too seldom; None if that was reported already."""
        period_s, ttl_s = self._history.period_s(), (last.expiry_us - last.host_us) / 1e6
        if period_s is None or period_s <= ttl_s:
            return self._stop(at_us, ("program_paused",), evidence)
        since_us, self._too_slow_us = self._too_slow_us, at_us
        if at_us - since_us < SPAN_US:
            return None
        text = f"setpoints every {period_s:.2f} s, ttl {ttl_s:.2f} s"
        return self._stop(at_us, ("ttl_too_short",), (text,))

    def _unobeyed(self, at_us: int, asked: list[Asked]) -> Stop:
        """Setpoints were asked for whose time had not run out."""
        recent = [
            RefusalCode(refuse.code)
            for when, refuse in self._history.refusals
            if when >= at_us - 2 * ANSWER_US
        ]
        if recent:
            code = max(set(recent), key=recent.count)
            name = REFUSALS.get(code, "setpoints_refused")
            text = f"{len(recent)} setpoints were refused: {code.name}. {code.doc}"
            return self._stop(at_us, (name,), (text,))
        evidence = [
            f"{len(asked)} setpoints were sent in the last seconds; the newest was not obeyed"
        ]
        session = self._rerun.session
        if session is not None:
            counted = session.statistics(self._rerun.host_us)
            evidence.append(
                f"{counted.frames_lost} frames of the robot were lost, {counted.bad_crc} had a "
                "wrong CRC"
            )
        return self._stop(at_us, ("line_corrupt",), evidence)

    def _lost(self, loss: _Loss) -> Stop:
        """The robot did not come back."""
        if loss.by_port:
            return self._stop(loss.host_us, ("cable_pulled",), (loss.text,))
        evidence = (
            loss.text,
            "it did not come back: the data do not show whether cable or power failed",
        )
        return self._stop(loss.host_us, ("cable_pulled", "power_lost"), evidence)

    def _back(self, loss: _Loss, now_us: int) -> Stop:
        away_s = (now_us - loss.host_us) / 1e6
        evidence = (loss.text, f"the same boot answered again {away_s:.1f} s later: it had power")
        frozen = self._history.longest_gap_s(loss.host_us - ANSWER_US) > 1.0
        cause = "host_frozen" if frozen or "suspended" in loss.text else "cable_pulled"
        return self._stop(loss.host_us, (cause,), evidence)

    def _reset(
        self, at_us: int, reason: ResetReason, samples: tuple[Measurement, ...], *, asked: bool
    ) -> Stop:
        evidence = [f"the device started again: {reason.name}. {reason.doc}", *supply_fall(samples)]
        name = RESETS[reason]
        causes: tuple[str, ...] = (name,)
        if reason is ResetReason.SOFTWARE and asked:
            causes = ("restart_requested",)
            evidence.append("a Restart was sent just before")
        elif reason in (ResetReason.BROWNOUT, ResetReason.POWER_ON):
            causes = self._by_supply(name, reason, samples, evidence)
        return self._stop(at_us, causes, evidence)

    def _by_supply(
        self, name: str, reason: ResetReason, samples: tuple[Measurement, ...], evidence: list[str]
    ) -> tuple[str, ...]:
        """A reset by the supply: an empty or low battery, one that is too weak, or a dip."""
        supply = self._history.supply.points()
        if not supply:
            if reason is ResetReason.POWER_ON:
                evidence.append("the battery is not measured: an empty one looks the same")
                return name, "battery_empty"
            return (name,)
        at_rest = [(at_us, volts) for at_us, volts, driven in supply if not driven]
        rest = at_rest or [(at_us, volts) for at_us, volts, _ in supply]
        fall_v = max(volts for _, volts in rest) - rest[-1][1]
        span_s = (rest[-1][0] - rest[0][0]) / 1e6
        if fall_v >= EMPTY_V and span_s >= EMPTY_S:
            evidence.append(
                f"at rest the supply fell by {fall_v:.1f} V within {span_s / 60:.0f} min"
            )
            return ("battery_empty",)
        # A supply that is switched off falls, too, but then the chip says POWER_ON.
        if reason is ResetReason.BROWNOUT and at_rest:
            return (self._weak_supply(at_rest[-1][1], samples, evidence) or name,)
        return (name,)

    def _weak_supply(
        self, rest_v: float, samples: tuple[Measurement, ...], evidence: list[str]
    ) -> str | None:
        """Whether the supply was low at rest already, or fell under load."""
        volts = [value for one in samples if drives(one) and (value := battery_v(one)) is not None]
        lowest_v = min(volts, default=rest_v)
        load = f", and fell to {lowest_v:.1f} V under load" if lowest_v < rest_v else ""
        evidence.append(f"the supply had {rest_v:.1f} V at rest{load}")
        nominal_v = self._nominal_v
        if nominal_v is not None and rest_v < LOW_PART * nominal_v:
            evidence.append(f"nominal_supply_v is {nominal_v:.1f} V")
            return "battery_low"
        return "battery_sags" if rest_v - lowest_v >= SAGS_PART * rest_v else None


def _same(stop: Stop | None) -> Stop | None:
    return stop


def stop_of(host_us: int, causes: tuple[str, ...], evidence: Iterable[str], side: str = "") -> Stop:
    """A stop with the causes of these names."""
    sentence = sentence_of(causes, side)
    return Stop(host_us, " or ".join(causes), sentence, tuple(evidence), look_at_of(causes))


def supply_fall(samples: Iterable[Measurement]) -> tuple[str, ...]:
    """What the supply did in these samples, if it is worth saying."""
    volts = [value for one in samples if (value := battery_v(one)) is not None]
    if not volts or max(volts) - min(volts) < SAG_V:
        return ()
    return (f"the supply fell from {max(volts):.1f} to {min(volts):.1f} V",)
