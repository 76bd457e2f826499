"""Requests: one at a time, repeated until answered, each answer taken once. Sans-IO.

A thread that finds nothing on the line begins a request by itself, and writes it: see `claim`.

Also the trial of parameters that an application holds: renewed while its session lasts.
"""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import ExitStack
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
_LANE = 0
"""The only key of the dictionary whose one value is the request on the line."""


def subject(message: RequestMessage) -> str:
    """What a person calls the request."""
    if isinstance(message, ParameterTrial):
        return f"to {TrialAction(message.action).name.lower()} a trial of parameters"
    if not isinstance(message, ParameterSet):
        return type(message).__name__
    definition = PARAMETER_BY_ID.get(message.parameter)
    name = definition.name if definition else f"parameter {message.parameter}"
    return f"{name} = {message.value:g}"


class Request:
    """A request that waits, or is on the line. Its request_id is 0 until it is begun."""

    def __init__(
        self, message: RequestMessage, done: Done, *, urgent: bool, deadline_us: int = 0
    ) -> None:
        self.message = message
        self.done = done
        self.urgent = urgent
        self.attempts = 0
        self.deadline_us = deadline_us
        self.frame = b""
        """To be written by the thread that began it, if one did."""


class RequestQueue:
    """The requests of one session after the other.

    The port's thread calls the methods; any thread may call `claim` and `begin`.

    Stop and Estop do not queue: the device neither caches nor orders them. The others go one at a
    time, because the device remembers only its last few answers. Each kind has its own count of
    ids: after 32768 stops in a row the device would take the next request's for an old one.

    Args:
        send: Takes a message for the line.
    """

    def __init__(self, send: Callable[[AnyMessage], None]) -> None:
        self.repeated = 0
        self._send_message = send
        self._waiting: deque[Request] = deque()
        self._stops: dict[int, Request] = {}
        """Unanswered stops, by id."""
        self._lane: dict[int, Request] = {}
        """The one other request on the line. The thread that puts it there, by one call into C,
        draws its id; only the port's thread removes it."""
        self._last_ids: dict[bool, int] = {}

    @property
    def next_deadline_us(self) -> int | None:
        """When `advance` has something to do."""
        # Queued requests have no deadline: the end of the one before sends them.
        request = self._lane.get(_LANE)
        if not self._stops:  # mostly, and each pass of a link asks
            return None if request is None else request.deadline_us
        return min(r.deadline_us for r in self._open)

    @property
    def is_open(self) -> bool:
        """Whether a request other than a stop is on the line, or about to be."""
        return bool(self._lane)

    def begin_session(self) -> None:
        """Count ids from the start: the device has forgotten the previous session's."""
        # No request is left to be dropped: the end of the previous session has aborted them all.
        self._last_ids = {}

    def snapshot(self) -> list[tuple[bool, int]]:
        """What `resume` takes: the last ids, as if the waiting requests already had theirs."""
        ids = dict(self._last_ids)
        on_line = self._lane.get(_LANE)
        if on_line is not None:  # its thread may be about to draw the id
            ids[False] = on_line.message.request_id or _id_after(ids.get(False, 0))
        for request in self._waiting:
            ids[request.urgent] = _id_after(ids.get(request.urgent, 0))
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
        request = Request(message, done, urgent=isinstance(message, (Stop, Estop)))
        if request.urgent:
            self._begin(request, now_us)
        else:
            self._waiting.append(request)
            self._begin_next(now_us)

    def claim(self, message: RequestMessage, done: Done, now_us: int) -> Request | None:
        """Put a request on the line, from any thread; None if others come before it.

        Nothing is locked. If the caller is interrupted for good before `begin`, nothing is sent,
        and `withdraw` ends the request.
        """
        request = Request(message, done, urgent=False, deadline_us=now_us + REPEAT_US)
        # One call into C, which no other thread and no signal handler can be in the middle of.
        return request if self._lane.setdefault(_LANE, request) is request else None

    def begin(self, request: Request, session_id: int) -> None:
        """Begin a request by the thread that put it on the line, which then writes its message."""
        request.attempts = 1
        # As `_id_after`, without the call.
        request_id = (self._last_ids.get(request.urgent, 0) + 1) % ID_MODULUS or COPY_ID + 1
        message = request.message
        # In this order, which `snapshot` relies on. As `_replace`, which is two calls more: each
        # request begins with these two.
        fields = session_id, request_id, *message[2:]
        request.message = tuple.__new__(type(message), fields)
        self._last_ids[request.urgent] = request_id

    def release_claimed(self, request: Request) -> bool:
        """Take a claimed request from the line before it is begun; False if it was aborted."""
        was_there = self._lane.get(_LANE) is request
        if was_there:
            del self._lane[_LANE]
        return was_there

    def advance(self, now_us: int) -> None:
        """Repeat what has waited long enough; give up what was repeated often enough."""
        # A copy: `done` of one that is given up may submit others, or end the session.
        for request in self._open:
            if request.deadline_us > now_us or not self._is_open(request):
                continue  # not due, or ended by what an earlier one's `done` did
            if not request.attempts:  # its thread has been held up, and is about to send it
                request.deadline_us = now_us + REPEAT_US
            elif request.attempts < (URGENT_ATTEMPTS if request.urgent else ATTEMPTS):
                self._repeat(request, now_us)
            else:
                name = type(request.message).__name__
                error = RequestTimeout(
                    f"no answer to {name} after {request.attempts} attempts: "
                    "check the link's statistics, and whether the device still runs"
                )
                self.finish(request, error, now_us)

    def answered_by(self, answer: Answer) -> Request | None:
        """The open request that an answer of this session belongs to; None if there is none."""
        if type(answer) is Ack and answer.message_id in _URGENT_IDS:
            request = self._stops.get(answer.request_id)
        else:  # as `_with_id`, without the call
            request = self._lane.get(_LANE)
        number = answer.request_id
        if request is None or not number or request.message.request_id != number:
            return None
        # An id alone is not enough: a previous host's answer may carry the same one.
        expected = ANSWERS.get(type(request.message), Ack)
        if type(answer) is not expected:
            return None
        if type(answer) is Ack and answer.message_id != message_id(type(request.message)):
            return None
        return request

    def on_refuse(self, refuse: Refuse, now_us: int, faults: Fault) -> bool:
        """Take a refusal of this session; False when it refuses no open request.

        Args:
            refuse: The refusal.
            now_us: The host's clock.
            faults: Latched.
        """
        request = self._with_id(refuse.message_id in _URGENT_IDS, refuse.reference)
        # As for an answer, the id alone is not enough.
        if request is None or refuse.message_id != message_id(type(request.message)):
            return False
        held = isinstance(request.message, ClearFault) or refuse.code == RefusalCode.FAULT
        error = DeviceRefused(refuse.code, subject(request.message), faults if held else NO_FAULT)
        self.finish(request, error, now_us)
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
        for request in self._open:
            if request.done != done:
                continue
            if request.urgent:
                # Requests never wait for a stop.
                del self._stops[request.message.request_id]
            else:
                # Still open, so that the next request does not overtake it on the line.
                request.attempts = ATTEMPTS

    def abort(self, error: WheelwireError) -> None:
        """End all requests with `error`."""
        # Removed first: a `done` may submit again, to the next session's queue. One call into C
        # takes it off the line, where another thread may put a request at any time.
        on_line = self._lane.pop(_LANE, None)
        requests = [*self._stops.values(), *self._waiting]
        self._stops.clear()
        self._waiting.clear()
        with ExitStack() as ends:  # each learns of it, in order, though one of them raises
            for request in reversed(requests if on_line is None else [on_line, *requests]):
                ends.callback(request.done, error)

    @property
    def _open(self) -> list[Request]:
        return [*self._lane.values(), *self._stops.values()]

    @property
    def _all(self) -> list[Request]:
        return [*self._open, *self._waiting]

    def _is_open(self, request: Request) -> bool:
        kind = self._stops if request.urgent else self._lane
        return any(one is request for one in kind.values())

    def _with_id(self, urgent: bool, request_id: int) -> Request | None:
        # A stop may have the same id as another request: each kind counts its own.
        if urgent:
            return self._stops.get(request_id)
        request = self._lane.get(_LANE)
        if request is None or not request_id or request.message.request_id != request_id:
            return None
        return request

    def _begin_next(self, now_us: int) -> None:
        # Only stops may be open at the same time: the order of all others matters to the device.
        if self._waiting and self._lane.setdefault(_LANE, self._waiting[0]) is self._waiting[0]:
            self._begin(self._waiting.popleft(), now_us)

    def _begin(self, request: Request, now_us: int) -> None:
        self.begin(request, request.message.session_id)
        request.deadline_us = now_us + REPEAT_US
        self._send_message(request.message)
        if request.urgent:
            self._stops[request.message.request_id] = request

    def _repeat(self, request: Request, now_us: int) -> None:
        self.repeated += 1
        request.attempts += 1
        # Only repeats of what is not urgent make the wait longer.
        doublings = 0 if request.urgent else request.attempts - 1
        request.deadline_us = now_us + min(REPEAT_US << doublings, LONGEST_WAIT_US)
        self._send_message(request.message)

    def finish(self, request: Request, result: Answer | WheelwireError, now_us: int) -> None:
        """Hand the result of an open request to its caller."""
        # The next one first: what `done` submits comes after the queued ones. It takes the line
        # without a gap in which another thread's request could overtake the queue.
        if request.urgent:
            del self._stops[request.message.request_id]
        elif self._waiting:
            self._lane[_LANE] = self._waiting[0]
            self._begin(self._waiting.popleft(), now_us)
        else:
            del self._lane[_LANE]
        request.done(result)


def _id_after(request_id: int) -> int:
    # After 65535 comes 1: copies of stops have 0, and so do requests not begun.
    return (request_id + 1) % ID_MODULUS or COPY_ID + 1


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


class _Trial:
    def __init__(self, timeout_s: float, now_us: int) -> None:
        self.timeout_s = timeout_s
        self.state = _State.RUNNING
        self.renewing = False
        self.wait(now_us)

    def wait(self, now_us: int) -> None:
        self.due_us = now_us + round(self.timeout_s * 1e6 / RENEWALS)


class HeldTrial:
    """What a session knows of its application's trial. At most one is held.

    Any thread may release it. That needs no lock: each method reads the held trial once, and only
    that object records what the method notes, even if the trial was just released.

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
            self.held = _Trial(request.timeout_s, now_us)
        elif request.action != TrialAction.RENEW:
            self.release()

    def renewal(self, now_us: int) -> ParameterTrial | None:
        """The request to send now, if any. `renewed` is to be called when it is over."""
        held, due_us = self.held, self.due_us
        if held is None or due_us is None or now_us < due_us:
            return None
        # No other renewal until this one is over: the same request is repeated.
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
