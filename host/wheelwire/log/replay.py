"""A link to a recording: the same samples, stamps and counters as on its day.

It answers only what a program asked on that day, and nothing that is sent to it has an effect. It
compares setpoints with the recorded ones.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice, takewhile
from typing import Any, TypeAlias, cast

from wheelwire_protocol import types as wire
from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import Group, StopMode
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import AnyMessage

from ..errors import InvalidCommand, LinkClosed, RecordingError, WheelwireError
from ..link.clock import host_clock_us
from ..link.device_link import STEP_S, InlineLink, Opening
from ..link.requests import Answer, Done, RequestMessage
from ..link.sample_stream import QUEUE_US, LatestSample
from ..link.setpoints import ASKED
from ..link.statistics import LinkStatistics
from ..link.traffic import Happening, Kind, Listener, Record, TrafficReader
from ..samples import Setpoint
from .rerun import RerunLink

LOOK_S = 0.002
"""Time between two checks whether the program reads samples by now."""
RECEIVED = (Kind.RECEIVED, Kind.RECEIVED_EACH)
AHEAD_US = 60_000_000
NOTES_AHEAD_US = 500_000
"""How long before its time a note is known."""
_Key: TypeAlias = tuple[type[AnyMessage], int]
_ANSWERS: dict[type[AnyMessage], str] = {
    wire.ParameterValue: "parameter",
    wire.ParameterEntry: "parameter_index",
    wire.GroupInfo: "group",
    wire.PeripheralValue: "channel",
    wire.LinkCounters: "",
    wire.ControlCounters: "",
    wire.Contradictions: "",
    wire.ConfigurationValue: "",
}
"""The answers of a replay, and the fields that identify an answer and its request."""
OPEN_S = 10.0
"""How much of a recording may pass before its first session is open."""
QUEUE = 100_000
"""Setpoints that wait for their counterpart, from either side."""
CLOSED = "the replay is closed; open it again"
ENDED = "the recording has ended"


@dataclass(frozen=True)
class Comparison:
    """The setpoints of this run next to the recorded ones, one by one in order."""

    compared: int = 0
    different: int = 0
    first_difference: tuple[int, Setpoint, Setpoint] | None = None
    """Its number, from 0; the recorded setpoint; the one of this run."""


class _Comparing:
    """Pairs setpoints as they come, from either side."""

    def __init__(self) -> None:
        self.result = Comparison()
        self._recorded: deque[Setpoint] = deque(maxlen=QUEUE)
        self._asked: deque[Setpoint] = deque(maxlen=QUEUE)
        self._lock = threading.Lock()

    def note(self, setpoint: Setpoint, *, is_recorded: bool) -> None:
        with self._lock:
            (self._recorded if is_recorded else self._asked).append(setpoint)
            while self._recorded and self._asked:
                recorded, asked = self._recorded.popleft(), self._asked.popleft()
                known = self.result
                differs = recorded != asked
                first = known.first_difference
                if differs and first is None:
                    first = known.compared, recorded, asked
                self.result = Comparison(known.compared + 1, known.different + differs, first)


class _Answers:
    """The device's recorded answers, for a program that asks the same again.

    Normally an answer recorded up to now. If there is none, the first within the next minute: this
    program may ask at its start what the recorded one asked a moment later.
    """

    def __init__(self, records: Callable[[], Iterable[Record]]) -> None:
        self._records = records
        self._known: dict[_Key, Answer] = {}
        self._ahead_from = -1
        self._feed = Decoder().feed

    def note(self, data: bytes) -> None:
        """Take in what came from the device."""
        self._known |= _answers_in(self._feed(data))

    def to(self, message: RequestMessage, session: int, now_us: int) -> Answer | None:
        """The answer, if there is one; `session` counts them, for each is looked ahead in once."""
        kind = wire.ANSWERS.get(type(message))
        if kind is None or kind not in _ANSWERS:
            return None
        key = _key(kind, message)
        if key not in self._known and self._ahead_from != session:
            self._ahead_from = session
            self._look_ahead(now_us)
        answer = self._known.get(key)
        # Setting a value that is already set changes nothing.
        if isinstance(message, wire.ParameterSet):
            return answer if getattr(answer, "value", None) == message.value else None
        return answer

    def _look_ahead(self, now_us: int) -> None:
        feed = Decoder().feed
        for record in self._records():
            if record.host_us > now_us + AHEAD_US:
                return
            if record.host_us >= now_us and record.kind in RECEIVED:
                self._known = _answers_in(feed(record.data)) | self._known


def _answers_in(messages: Iterable[AnyMessage]) -> dict[_Key, Answer]:
    answers = [cast("Answer", message) for message in messages if type(message) in _ANSWERS]
    found = {_key(type(answer), answer): answer for answer in answers}
    for answer in answers:
        if isinstance(answer, wire.ParameterEntry):  # it also says what its value is
            value = wire.ParameterValue(0, 0, answer.parameter, answer.value)
            found[_key(wire.ParameterValue, value)] = value
    return found


def _key(kind: type[AnyMessage], message: AnyMessage) -> _Key:
    """What an answer of this kind is known by; `message` is the answer, or its request."""
    field = _ANSWERS[kind]
    return kind, getattr(message, field) if field else 0


class ReplayLink(RerunLink, InlineLink):
    """A link to a recording.

    Args:
        latest_sample: Takes the samples.
        name: Name of the recording, for messages.
        records: Gives all of it, in order, from the beginning whenever it is called.
        speed: How much faster than on the day time passes; 0: only in `advance`.
        check_cut_off: Raises the error of a file that was cut off, if it was.
    """

    def __init__(
        self,
        latest_sample: LatestSample,
        name: str,
        records: Callable[[], Iterable[Record]],
        speed: float,
        check_cut_off: Callable[[], None] = lambda: None,
    ) -> None:
        super().__init__(latest_sample)
        self.in_virtual_time = not speed
        latest_sample.now_us = lambda: self.now_us
        # A faster replay leaves its reader as long, on this computer's clock.
        latest_sample.queue_us = round(QUEUE_US * max(1.0, speed))
        if not speed:
            latest_sample.wait_for = self.wait_for
        self._name = name
        self._records: Iterator[Record] = iter(())
        self._answers = _Answers(records)
        self._open_records = records
        self._check_cut_off = check_cut_off
        self._next: Record | None = None
        self._speed = speed
        self._comparing = _Comparing()
        self._notes: dict[str, Any] = {}
        self._connections = 0
        self._played_us = 0
        """The recorded clock at the point up to which the session has been replayed."""
        self._is_used = False
        """Whether the program has sent or listens to something; time then passes unread."""
        self._began: tuple[int, float] | None = None
        """That clock, and this computer's, when time began to pass."""
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"wheelwire {name}", daemon=True)

    # --- time ----------------------------------------------------------------------------------

    @property
    def now_us(self) -> int:
        """The recorded clock."""
        began = self._began
        if not self._speed or began is None:
            return self._played_us
        return began[0] + round((time.monotonic() - began[1]) * self._speed * 1e6)

    def advance(self, seconds: float) -> None:
        """Let the recording's time pass; for a speed of 0."""
        if self._speed:
            super().advance(seconds)
        self._check_alive()
        until_us = self._played_us + round(seconds * 1e6)
        while self._next is not None and self._next.host_us <= until_us:
            self._play(self._next)
        self._played_us = max(self._played_us, until_us)
        if self._next is None:
            self._finish(LinkClosed(ENDED))

    def _pass(self, most_us: int) -> None:  # noqa: ARG002 - a gap is skipped whole
        # Nothing changes before the next record, which may be hours away.
        ahead_us = 0 if self._next is None else self._next.host_us - self._played_us
        self.advance(max(STEP_S, ahead_us / 1e6))

    def _play(self, record: Record) -> None:
        """Run one record, and look ahead to the next."""
        self._next = next(self._records, None)
        self._played_us = max(self._played_us, record.host_us)
        self._connections += record.kind is Kind.CONNECTED
        if record.kind is Kind.NOTE:
            self._notes |= _note_of(record)
        if record.kind in RECEIVED:
            self._answers.note(record.data)
        self._do_again(record)
        if record.kind in (Kind.VELOCITY, Kind.DUTY):  # the session took it: it is not damaged
            left, right, _ = ASKED.unpack(record.data)
            setpoint = Setpoint(left, right, record.kind is Kind.DUTY)
            self._comparing.note(setpoint, is_recorded=True)
        if record.kind in RECEIVED:
            self._latest_sample.notify_all()

    def _begin(self) -> None:
        """Find where the recording begins."""
        self._records = _notes_first(self._open_records())
        self._next = next(self._records, None)
        if self._next is None or self._next.kind is not Kind.START:
            self._check_cut_off()
            raise RecordingError(
                f"{self._name}: it holds nothing of a link; record the robot again"
            )
        # One that begins in the middle of a session was connected before.
        self._connections = b'"phase": "OPEN"' in self._next.data
        self._played_us = self._next.host_us
        self._play(self._next)

    def _run(self) -> None:
        """Play in time: the thread's main function."""
        # A program that opens a robot is a moment later ready to read it: it gets all samples.
        while not self._is_used and not self._latest_sample.is_read(host_clock_us()):
            if self._ending.wait(LOOK_S):
                return
        self._began = self._played_us, time.monotonic()
        try:
            while self._next is not None:
                ahead_s = (self._next.host_us - self.now_us) / 1e6 / self._speed
                if self._ending.is_set() or (ahead_s > 0 and self._ending.wait(ahead_s)):
                    return
                self._play(self._next)
            self._finish(LinkClosed(ENDED))
        except ValueError as error:  # of a record, or of the file below it
            self._finish(RecordingError(f"{self._name}: {error}"))
        except RecordingError as error:
            self._finish(error)

    def _finish(self, end: LinkClosed | RecordingError) -> None:
        if self._end is not None:
            return
        self._end = end
        if isinstance(end, LinkClosed):
            self._latest_sample.close()  # iterators end, without an error
        self._latest_sample.fail(end)
        self.changed.notify_all()

    # --- opening and closing -------------------------------------------------------------------

    def open(self) -> None:
        """Play up to the first session.

        Raises:
            RecordingError: There is no session within 10 s, or the file is damaged.
        """
        next(self.opening())  # all at once: nothing is waited for

    def opening(self) -> Opening:
        """As `Link.opening`."""
        try:
            self._begin()
            # All at once: do not repeat the recorded waits.
            until_us = self._played_us + round(OPEN_S * 1e6)
            while not self._is_open and self._next is not None and self._next.host_us <= until_us:
                self._play(self._next)
        except ValueError as error:
            raise RecordingError(f"{self._name}: {error}") from error
        if not self._is_open:
            if self._next is None:
                self._check_cut_off()
            raise RecordingError(
                f"{self._name}: no session was open within {OPEN_S:g} s of its beginning; "
                "record a robot that answers"
            )
        if self._speed:
            self._thread.start()
        yield lambda: True, 0.0

    def finish(self) -> None:
        """Begin to close, without waiting."""
        self._ending.set()

    def close(self) -> None:
        """End the replay. Safe to call more than once."""
        self.finish()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join()
        self._finish(LinkClosed(CLOSED))

    # --- what is known ---------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The recording."""
        return self._name

    @property
    def statistics(self) -> LinkStatistics:
        """What was counted up to this moment of the day."""
        return self._session.statistics(self._rerun.host_us, max(0, self._connections - 1))

    @property
    def comparison(self) -> Comparison:
        """The setpoints of this run, next to the recorded ones."""
        return self._comparing.result

    def why_no_sensors(self, waited_s: float) -> WheelwireError:
        """As `DeviceLink.why_no_sensors`."""
        if self._session.sensors.rate_hz:
            return super().why_no_sensors(waited_s)
        return self._nobody_asked

    @property
    def _nobody_asked(self) -> InvalidCommand:
        return InvalidCommand(
            f"{self._name} is a recording, and no program had requested the sensors' samples "
            "by then: call "
            "`robot.sensors.start()` in the program that is recorded"
        )

    def listen(self, listener: Listener, happening: Happening) -> None:
        """As `Link.listen`."""
        super().listen(listener, happening)
        self._is_used = True

    def noted(self, name: str) -> Any:
        """What the recorded program said of itself up to now and half a second later.

        If that is nothing, what it said first within the minute ahead, or None.
        """
        if name not in self._notes:
            ahead_us = self._played_us + AHEAD_US
            ahead = takewhile(lambda record: record.host_us <= ahead_us, self._open_records())
            notes = (_note_of(record) for record in ahead if record.kind is Kind.NOTE)
            self._notes[name] = next((note[name] for note in notes if name in note), None)
        return self._notes[name]

    def note(self, what: Mapping[str, Any]) -> None:
        """A replay is recorded nowhere."""

    def listen_to_traffic(self, reader: TrafficReader) -> None:  # noqa: ARG002 - refused
        """A replay passes nothing on: it is in the file already.

        Raises:
            InvalidCommand: Always.
        """
        raise InvalidCommand(f"{self._name} is a recording already: copy the file")

    # --- what is asked for -----------------------------------------------------------------------

    def drive_velocity(self, left_mps: float, right_mps: float, expiry_us: int) -> None:  # noqa: ARG002
        """Compare a setpoint with the recorded one."""
        self._compare(Setpoint(left_mps, right_mps, duty=False))

    def drive_duty(self, left: float, right: float, expiry_us: int) -> None:  # noqa: ARG002
        """As `drive_velocity`."""
        self._compare(Setpoint(left, right, duty=True))

    def _compare(self, asked: Setpoint) -> None:
        self._is_used = True
        self.check()
        self._comparing.note(asked, is_recorded=False)

    def post(self, message: RequestMessage, done: Done) -> None:
        """Call `done` with what the device had answered by then.

        An `InvalidCommand` if that is not known, or if the request would change something.
        """
        self.check()
        known = self.reported.values
        if isinstance(message, wire.SensorStream):
            self._is_used = True
            done(wire.Ack(0, 0, message_id(wire.SensorStream)))  # they come as on that day
        elif isinstance(message, wire.ParameterGet) and message.parameter in known:
            done(wire.ParameterValue(0, 0, message.parameter, known[message.parameter]))
        elif answer := self._answers.to(message, self._session.count, self._played_us):
            done(answer)
        elif isinstance(message, wire.GroupGet) and message.group == Group.SENSOR:
            done(self._nobody_asked)  # a caller checks this first
        else:
            done(
                InvalidCommand(
                    f"{type(message).__name__}: {self._name} is a recording, which has only "
                    "the recorded answers; ask a robot"
                )
            )

    def post_stop(
        self,
        done: Done,
        mode: StopMode | None = StopMode.CONFIGURED,  # noqa: ARG002
    ) -> None:
        """Nothing moves."""
        self._check_alive()
        done(wire.Ack(0, 0, message_id(wire.Stop)))

    def withdraw(self, done: Done) -> None:
        """Everything is answered at once."""


def _notes_first(records: Iterable[Record]) -> Iterator[Record]:
    """The records, with notes a while before their time: a program may note a sample late.

    The session gets no notes, so their order among its inputs does not matter.
    """
    rest = iter(records)
    yield from islice(rest, 1)  # the START
    waiting: deque[Record] = deque()
    for record in rest:
        if record.kind is Kind.NOTE:
            yield record._replace(host_us=waiting[0].host_us) if waiting else record
            continue
        waiting.append(record)
        while waiting[0].host_us + NOTES_AHEAD_US <= record.host_us:
            yield waiting.popleft()
    yield from waiting


def _note_of(record: Record) -> dict[str, Any]:
    note = json.loads(record.data)
    return note if isinstance(note, dict) else {}
