"""Requests: one at a time, repeated until answered, each answer taken once. Sans-IO.

Also the trial of parameters that an application holds: renewed while its session lasts.
"""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TypeAlias

from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import Fault, RefusalCode, TrialAction
from wheelwire_protocol.parameters import PARAMETER_BY_ID
from wheelwire_protocol.types import (
    ANSWERS,
    Ack,
    AnyAnswer,
    AnyMessage,
    AnyRequest,
    ClearFault,
    Estop,
    ParameterSet,
    ParameterTrial,
    Refuse,
    Stop,
)

from ..errors import NO_FAULT, DeviceRefused, RequestTimeout, WheelwireError

RequestMessage: TypeAlias = AnyRequest
Answer: TypeAlias = AnyAnswer
Done: TypeAlias = Callable[[Answer | WheelwireError], None]

REPEAT_US = 25_000
"""An answer takes less on nearly every line. On a slower one a repeat costs one more answer."""
LONGEST_WAIT_US = 100_000
"""Each repeat waits twice as long as the one before it, up to this: the device may be busy."""
ATTEMPTS = 12
"""Enough to succeed within about 1 s at 70 % loss."""
URGENT_ATTEMPTS = 40
"""Copies of a stop within a second. Its waits do not grow: each copy does no harm."""
ID_MODULUS = 1 << 16
COPY_ID = 0
"""The id of the copy of a stop that its caller wrote; no request that awaits an answer has it."""
_URGENT_IDS = frozenset({message_id(Stop), message_id(Estop)})


def subject(message: RequestMessage) -> str:
    """What a person calls the request."""
    if isinstance(message, ParameterTrial):
        return f"to {TrialAction(message.action).name.lower()} a trial of parameters"
    if not isinstance(message, ParameterSet):
        return type(message).__name__
    definition = PARAMETER_BY_ID.get(message.parameter)
    name = definition.name if definition else f"parameter {message.parameter}"
    return f"{name} = {message.value:g}"


@dataclass
class _Request:
    message: RequestMessage
    done: Done
    urgent: bool
    attempts: int = 0
    deadline_us: int = 0


def _key(answer: Answer) -> tuple[bool, int]:
    # A stop may have the same id as another request: each kind counts its own.
    return isinstance(answer, Ack) and answer.message_id in _URGENT_IDS, answer.request_id


@dataclass
class RequestQueue:
    """The requests of one session after the other.

    Stop and Estop do not queue: the device neither caches nor orders them. The others go one at a
    time, for the device remembers only its last few answers. Each kind counts its ids by itself:
    after 32768 stops in a row the device would take the next request's for an old one.

    Args:
        send: Takes a message for the line.
    """

    send: Callable[[AnyMessage], None]
    repeated: int = 0
    _waiting: deque[_Request] = field(default_factory=deque)
    _open: dict[tuple[bool, int], _Request] = field(default_factory=dict)
    """(urgent, request_id) -> the request that is not answered yet."""
    _last_ids: dict[bool, int] = field(default_factory=dict)

    @property
    def next_deadline_us(self) -> int | None:
        """When `advance` has something to do."""
        # Those that wait behind another have no deadline: the end of the one before sends them.
        if not self._open:  # mostly, and each pass of a link asks
            return None
        return min(r.deadline_us for r in self._open.values())

    def begin_session(self) -> None:
        """Count ids from the start: the device has forgotten the previous session's."""
        # No request is left to be dropped: the end of the previous session has aborted them all.
        self._last_ids.clear()

    def snapshot(self) -> list[tuple[bool, int]]:
        """What `resume` takes: the last ids, as if the waiting requests already had theirs."""
        ids = dict(self._last_ids)
        for request in self._waiting:
            ids[request.urgent] = (ids.get(request.urgent, 0) + 1) % ID_MODULUS
        return list(ids.items())

    def resume(self, ids: Iterable[tuple[bool, int]]) -> None:
        """Count on behind the ids of a snapshot."""
        self._last_ids = dict(ids)

    def submit(self, message: RequestMessage, done: Done, now_us: int) -> None:
        """Send `message`, now or after those before it; its request_id is filled in.

        Args:
            message: With its session_id; the request_id is replaced.
            done: Called exactly once, with the answer or the error.
            now_us: The host's clock.
        """
        request = _Request(message, done, urgent=isinstance(message, (Stop, Estop)))
        if request.urgent:
            self._begin(request, now_us)
        else:
            self._waiting.append(request)
            self._begin_next(now_us)

    def advance(self, now_us: int) -> None:
        """Repeat what has waited long enough; give up what was repeated often enough."""
        # A copy: `done` of one that is given up may submit others, or end the session.
        for key, request in list(self._open.items()):
            if request.deadline_us > now_us or key not in self._open:
                continue  # not due, or ended by what an earlier one's `done` did
            if request.attempts < (URGENT_ATTEMPTS if request.urgent else ATTEMPTS):
                self.repeated += 1
                self._send(request, now_us)
            else:
                name = type(request.message).__name__
                error = RequestTimeout(
                    f"no answer to {name} after {request.attempts} attempts: "
                    "check the link's statistics, and whether the device still runs"
                )
                self._finish(key, error, now_us)

    def answered_by(self, answer: Answer) -> RequestMessage | None:
        """The open request that an answer of this session belongs to; None if there is none."""
        request = self._open.get(_key(answer))
        if request is None:
            return None
        # An id alone is not enough: a previous host's answer may carry the same one.
        expected = ANSWERS.get(type(request.message), Ack)
        if type(answer) is not expected:
            return None
        if isinstance(answer, Ack) and answer.message_id != message_id(type(request.message)):
            return None
        return request.message

    def on_answer(self, answer: Answer, now_us: int) -> None:
        """Hand an answer for which `answered_by` has found the request to whoever asked."""
        self._finish(_key(answer), answer, now_us)

    def on_refuse(self, refuse: Refuse, now_us: int, faults: Fault) -> bool:
        """Take a refusal of this session; False when it refuses no open request.

        Args:
            refuse: The refusal.
            now_us: The host's clock.
            faults: Latched.
        """
        key = refuse.message_id in _URGENT_IDS, refuse.reference
        request = self._open.get(key)
        # As for an answer, the id alone is not enough.
        if request is None or refuse.message_id != message_id(type(request.message)):
            return False
        held = isinstance(request.message, ClearFault) or refuse.code == RefusalCode.FAULT
        error = DeviceRefused(refuse.code, subject(request.message), faults if held else NO_FAULT)
        self._finish(key, error, now_us)
        return True

    def places(self, done: Done) -> list[int]:
        """Where `done` waits, among the requests that are open and those that wait."""
        return [place for place, request in enumerate(self._all) if request.done == done]

    def waiting_at(self, places: Iterable[int]) -> list[Done]:
        """The callers that wait at these places."""
        requests = self._all
        return [requests[place].done for place in places if place < len(requests)]

    def withdraw(self, done: Done) -> None:
        """The caller that waited for `done` has given up.

        What was not sent yet is not sent. What was sent may have been carried out, but is not sent
        again: a late copy would undo what is asked for next. Other requests still wait until it is
        answered, or its time is up.
        """
        self._waiting = deque([r for r in self._waiting if r.done != done])
        for key, request in list(self._open.items()):
            if request.done != done:
                continue
            if request.urgent:
                # Nothing waits behind a stop.
                del self._open[key]
            else:
                # Still open, so that the next request does not overtake it on the line.
                request.attempts = ATTEMPTS

    def abort(self, error: WheelwireError) -> None:
        """End all requests with `error`."""
        # Cleared first: a `done` may submit again, to the next session's queue.
        requests = self._all
        self._open.clear()
        self._waiting.clear()
        for request in requests:
            request.done(error)

    @property
    def _all(self) -> list[_Request]:
        return [*self._open.values(), *self._waiting]

    def _begin_next(self, now_us: int) -> None:
        # Only stops may be open beside it: the order of all others matters to the device.
        if self._waiting and all(request.urgent for request in self._open.values()):
            self._begin(self._waiting.popleft(), now_us)

    def _begin(self, request: _Request, now_us: int) -> None:
        # Ids go from 65535 on to 0, which stops leave out: their copies have it.
        request_id = (self._last_ids.get(request.urgent, 0) + 1) % ID_MODULUS
        if request.urgent and request_id == COPY_ID:
            request_id += 1
        self._last_ids[request.urgent] = request_id
        request.message = request.message._replace(request_id=request_id)
        self._send(request, now_us)
        self._open[request.urgent, request_id] = request

    def _send(self, request: _Request, now_us: int) -> None:
        request.attempts += 1
        # The first wait is REPEAT_US for all: only repeats of what is not urgent make it longer.
        doublings = 0 if request.urgent else request.attempts - 1
        request.deadline_us = now_us + min(REPEAT_US << doublings, LONGEST_WAIT_US)
        self.send(request.message)

    def _finish(self, key: tuple[bool, int], result: Answer | WheelwireError, now_us: int) -> None:
        request = self._open.pop(key)
        # The next one first: what `done` submits comes after those that wait already.
        self._begin_next(now_us)
        request.done(result)


# --- the trial of parameters ----------------------------------------------------------------------

SHORTEST_TRIAL_S, LONGEST_TRIAL_S = 0.2, 60.0
"""The time-outs that a device takes."""
RENEWALS = 4
"""In each time-out: some may be lost."""


class _State(enum.Enum):
    RUNNING = enum.auto()
    ENDING = enum.auto()
    """The device was asked to keep or revert it."""
    LOST = enum.auto()
    """The device has reverted it, and the application has not left it yet."""


@dataclass(slots=True)
class _Trial:
    timeout_s: float
    due_us: int
    state: _State = _State.RUNNING
    renewing: bool = False

    def wait(self, now_us: int) -> None:
        self.due_us = now_us + round(self.timeout_s * 1e6 / RENEWALS)


class HeldTrial:
    """What a session knows of its application's trial. At most one is held.

    Any thread may release it. That needs no lock: each method takes the trial that is held once,
    and what it notes of a trial that was released meanwhile is recorded nowhere else.

    Attributes:
        held: None while the application tries nothing.
    """

    def __init__(self) -> None:
        self.held: _Trial | None = None

    @property
    def due_us(self) -> int | None:
        """When to renew it next."""
        held = self.held
        if held is None or held.state is not _State.RUNNING or held.renewing:
            return None
        return held.due_us

    def check(self, subject: str) -> None:
        """Raise `DeviceRefused` for what relies on values that are no longer active."""
        held = self.held
        if held is not None and held.state is _State.LOST:
            raise DeviceRefused(RefusalCode.NO_TRIAL, subject)

    def on_request(self, request: ParameterTrial) -> None:
        """The application asks for it.

        Raises:
            DeviceRefused: Another one is held.
        """
        held = self.held
        if held is None:
            return
        if request.action == TrialAction.BEGIN:
            raise DeviceRefused(RefusalCode.ON_TRIAL, "another trial of parameters")
        if held.state is _State.RUNNING:
            held.state = _State.ENDING  # a renewal after that would find none

    def on_done(self, request: ParameterTrial, now_us: int) -> None:
        """The device has done what it was asked for."""
        if request.action == TrialAction.BEGIN:
            begun = _Trial(request.timeout_s, now_us)
            begun.wait(now_us)
            self.held = begun
        elif request.action != TrialAction.RENEW:
            self.release()

    def renewal(self, now_us: int) -> ParameterTrial | None:
        """The request to send now, if any. `renewed` is to be called when it is over."""
        held, due_us = self.held, self.due_us
        if held is None or due_us is None or now_us < due_us:
            return None
        # None beside it until it is over: the request is repeated as it is.
        held.renewing = True
        held.wait(now_us)
        return ParameterTrial(0, 0, TrialAction.RENEW, held.timeout_s)

    def renewed(self) -> None:
        """The renewal was answered, or given up."""
        held = self.held
        if held is not None:
            held.renewing = False

    def lose(self) -> None:
        """The session is over, and the trial with it."""
        held = self.held
        if held is not None:
            held.state = _State.LOST

    def release(self) -> None:
        """The application has left it; from any thread."""
        self.held = None
