"""What a recording shows over time: speeds asked and measured, duties, states, faults."""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from wheelwire_protocol.codes import Fault, SupervisorState

from ..link.sample_stream import DUTY_SCALE, Measurement
from ..link.session import Phase, Session
from ..link.setpoints import ASKED
from ..link.traffic import Kind, Record
from .rerun import Rerun


def _floats() -> array[float]:
    return array("d")


@dataclass
class Asked:
    """Setpoints: from when to when each was asked for, and of which wheel what."""

    begins_s: array[float] = field(default_factory=_floats)
    ends_s: array[float] = field(default_factory=_floats)
    left: array[float] = field(default_factory=_floats)
    right: array[float] = field(default_factory=_floats)


class Band(NamedTuple):
    """The robot's state from `begin_s` to `end_s`; None: out of reach."""

    begin_s: float
    end_s: float
    state: SupervisorState | None


class Mark(NamedTuple):
    """Faults that were latched at a moment."""

    time_s: float
    faults: Fault


@dataclass
class Trace:
    """Times are in seconds since the recording's beginning, at the arrival of each frame.

    Attributes:
        times_s: Times of the samples.
        left_mps: Measured.
        right_mps: Measured.
        left_duty: On the output, -1..1.
        right_duty: On the output, -1..1.
        asked_speed: Setpoints for velocities. [m/s]
        asked_duty: Setpoints for duties.
        bands: The supervisor's states, side by side.
        marks: Faults, each when it was latched.
        begin_us: When the recording begins, by the host's clock.
        end_s: The recording's length.
    """

    times_s: array[float] = field(default_factory=_floats)
    left_mps: array[float] = field(default_factory=_floats)
    right_mps: array[float] = field(default_factory=_floats)
    left_duty: array[float] = field(default_factory=_floats)
    right_duty: array[float] = field(default_factory=_floats)
    asked_speed: Asked = field(default_factory=Asked)
    asked_duty: Asked = field(default_factory=Asked)
    bands: list[Band] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    begin_us: int = 0
    end_s: float = 0.0

    @classmethod
    def of(cls, records: Iterable[Record]) -> Trace:
        """Run a recording again, and collect what it shows.

        Raises:
            ValueError: A record is none of this release.
        """
        return _Tracing().trace_of(records)


class _Tracing:
    """Fills a trace."""

    def __init__(self) -> None:
        self._trace = Trace()
        self._state: SupervisorState | None = None
        self._since_s = 0.0
        self._opened_s: float | None = None
        """When the session was opened."""
        self._faults = Fault(0)

    def trace_of(self, records: Iterable[Record]) -> Trace:
        again, trace = Rerun(), self._trace
        for record in records:
            trace.begin_us = trace.begin_us or record.host_us
            if record.kind in (Kind.VELOCITY, Kind.DUTY):
                self._note_asked(record)
            elif record.kind in (Kind.STOP, Kind.STOP_COPY):
                self._end_asked(self._seconds(record.host_us))
            for measurement in again.feed(record):
                self._note(measurement)
            self._note_reach(again.session, record.host_us)
        trace.end_s = self._seconds(again.host_us)
        self._change(None, trace.end_s)
        return trace

    def _seconds(self, host_us: int) -> float:
        return (host_us - self._trace.begin_us) / 1e6

    def _note_asked(self, record: Record) -> None:
        left, right, expiry_us = ASKED.unpack(record.data)
        self._end_asked(self._seconds(record.host_us))
        trace = self._trace
        asked = trace.asked_duty if record.kind is Kind.DUTY else trace.asked_speed
        asked.begins_s.append(self._seconds(record.host_us))
        asked.ends_s.append(self._seconds(expiry_us))
        asked.left.append(left)
        asked.right.append(right)

    def _end_asked(self, now_s: float) -> None:
        """End a setpoint: at its expiry, the next setpoint of either kind, or a stop."""
        for asked in (self._trace.asked_speed, self._trace.asked_duty):
            if asked.ends_s and asked.ends_s[-1] > now_s:
                asked.ends_s[-1] = now_s

    def _note(self, measurement: Measurement) -> None:
        trace, state = self._trace, measurement.state
        now_s = self._seconds(measurement.arrived_us)
        trace.times_s.append(now_s)
        trace.left_mps.append(state.left_mps)
        trace.right_mps.append(state.right_mps)
        trace.left_duty.append(state.left_duty_q15 / DUTY_SCALE)
        trace.right_duty.append(state.right_duty_q15 / DUTY_SCALE)
        if measurement.supervisor is not self._state:
            # The first sample of a session shows the state that it was opened in.
            opened_s = self._opened_s if self._state is None else None
            self._change(measurement.supervisor, now_s if opened_s is None else opened_s)
        if measurement.faults != self._faults:
            if fresh := measurement.faults & ~self._faults:
                trace.marks.append(Mark(now_s, fresh))
            self._faults = measurement.faults

    def _note_reach(self, session: Session | None, host_us: int) -> None:
        if session is not None and session.phase is Phase.OPEN:
            if self._opened_s is None:
                self._opened_s = self._seconds(host_us)
            return
        self._opened_s = None
        if self._state is not None:
            self._change(None, self._seconds(host_us))

    def _change(self, state: SupervisorState | None, now_s: float) -> None:
        if now_s > self._since_s:
            self._trace.bands.append(Band(self._since_s, now_s, self._state))
        self._state, self._since_s = state, now_s
