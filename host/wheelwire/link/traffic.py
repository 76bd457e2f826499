"""What a link passes on: everything that crosses it to its readers, and events to its listeners.

Every input of the session and every byte that it wrote crosses the link.

The inputs alone decide what a session does. Another session that gets them in the same order
(`recording.replay`) produces the same samples, counters and stamps.

Each listener has its own queue, which drops the oldest records when it is full. Nothing here waits,
locks or writes, so a slow listener costs the link nothing.
"""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Callable, Mapping
from itertools import count
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from ..errors import WheelwireError

if TYPE_CHECKING:
    from .session import Session

QUEUE = 20_000
"""Records that wait for a listener: 5 s of a link at 1 kHz that is driven at 1 kHz."""


STOP_ASKED = "stop_asked"
"""The note of which other program asked the link for a stop: `by`, `host_us`."""


ESTOP = 255
"""The mode of an e-stop."""
ATTACHED = 254
"""The mode of a stop that attached programs asked for."""


class Kind(enum.IntEnum):
    """What a record says, and what its `data` is."""

    START = 0
    """The session as a listener finds it: JSON, see `handover.start_of`."""
    CONNECTED = 1
    """The port was opened. Empty."""
    DISCONNECTED = 2
    """The port was lost or closed. Why, as UTF-8."""
    RENEWED = 3
    """A new session is wanted. Why, as UTF-8."""
    NONCE = 4
    """Drawn for the next hello: u32."""
    ADVANCED = 5
    """The session did what was due. Empty."""
    RECEIVED = 6
    """Bytes that arrived together; the newest of their state frames became a sample."""
    RECEIVED_EACH = 7
    """Bytes that arrived together; each of their state frames became a sample."""
    SENT = 8
    """Bytes that the port took; no input of the session."""
    REQUEST = 9
    """The application's request: an encoded frame, its ids not filled in."""
    STOP = 10
    """The application stops: mode, u8; `ESTOP` for an e-stop, `ATTACHED` for attached programs."""
    STOP_COPY = 11
    """As STOP: its copy, which the calling thread writes at once."""
    VELOCITY = 12
    """The application's setpoint: left, right [m/s], expiry [us, host's clock]: f64 f64 i64."""
    DUTY = 13
    """As VELOCITY, in duties of -1..1."""
    WITHDRAWN = 14
    """Requests were given up: their positions among the open and queued ones, u32 each."""
    RELEASED = 15
    """The application left its trial of parameters. Empty."""
    NOTE = 16
    """What the application says of itself; no input of the session. An object as JSON."""


class Record(NamedTuple):
    """One thing that happened."""

    number: int
    """Counts all records of the link; what is missing was lost on the way to this listener."""
    kind: Kind
    host_us: int
    """The host's monotonic clock."""
    data: bytes = b""


class TrafficReader:
    """One listener's queue. The link's threads append; the listener's own takes.

    Attributes:
        lost: How many records fell from the queue before they were taken.
        failure: Why the link gives it nothing.
    """

    def __init__(self, limit: int = QUEUE) -> None:
        self.lost = 0
        self.failure: WheelwireError | None = None
        self._queue: deque[Record] = deque(maxlen=limit)
        self._limit = limit
        self._missing: int | None = None
        """How many numbers up to the highest were not taken yet; None before the first record."""
        self._highest = -1
        self.append = self._queue.append

    def take(self) -> list[Record]:
        """What was not taken yet, in order. Never waits."""
        # One call into C each: the link's threads append at any time.
        taken = [self._queue.popleft() for _ in range(len(self._queue))]
        if taken:
            self._note_what_is_missing(taken)
        return taken

    def _note_what_is_missing(self, taken: list[Record]) -> None:
        before = self._highest
        self._highest = max(before, *(record.number for record in taken))
        if self._missing is None:
            before = taken[0].number - 1
            self._missing = 0
        self._missing += self._highest - before - len(taken)
        # Not by the numbers alone: of two threads' records one may overtake the other.
        if self._missing > 0 and len(taken) > self._limit // 2:
            self.lost += self._missing
            self._missing = 0


class Traffic:
    """Passes on what happens on one link.

    Attributes:
        readers: The readers. Replaced as a whole. Empty in most programs, so check this before
            encoding a record.
        host_us: When the newest record was put.
    """

    def __init__(self) -> None:
        self.readers: tuple[TrafficReader, ...] = ()
        self.host_us = 0
        self._numbers = count()
        self._said: dict[str, Any] = {}

    def put(self, kind: Kind, host_us: int, data: bytes = b"") -> None:
        """Pass one record on, if anybody listens; from any thread."""
        if not self.readers:
            return
        self.host_us = host_us
        record = Record(next(self._numbers), kind, host_us, data)
        for reader in self.readers:
            reader.append(record)

    def add(self, reader: TrafficReader, start: bytes) -> None:
        """From now on `reader` gets all; first the session as it is, `start`, and the notes."""
        number = next(self._numbers)
        # The others are not to miss its number.
        for other in self.readers:
            other.append(Record(number, Kind.NOTE, self.host_us, b"{}"))
        reader.append(Record(number, Kind.START, self.host_us, start))
        self.readers = (*self.readers, reader)
        if self._said:
            self.put(Kind.NOTE, self.host_us, _as_json(self._said))

    def note(self, what: Mapping[str, Any], host_us: int) -> None:
        """Pass on an application's note; later readers get the newest of each name."""
        data = _as_json(what)  # first: what cannot be written is not kept either
        self._said = {**self._said, **what}
        self.put(Kind.NOTE, host_us, data)

    def remove(self, reader: TrafficReader) -> None:
        """`reader` gets nothing more. Harmless when repeated."""
        self.readers = tuple(one for one in self.readers if one is not reader)


def _as_json(what: Mapping[str, Any]) -> bytes:
    import json  # here, for most programs note nothing

    return json.dumps(what).encode()


# --- what happens -------------------------------------------------------------------------------


class Happening(enum.Enum):
    """What has happened. The value is the name of a driver's callback."""

    LOST = "on_lost"
    """The robot is out of reach; reported with the error that every call raises."""
    OPENED = "on_opened"
    """A session was opened; reported with the device."""
    FAULT = "on_fault"
    """A fault was latched; reported with all that are."""
    HELD = "on_held"
    """What holds the robot has changed; reported with all that does."""
    STOPPED = "watch_stops"
    """The robot has stopped; reported with the stop, by a watch, and never by the link itself."""


class StandingNotice(NamedTuple):
    """Notice of what was so already when a listener asked for it, which may be a repeat."""

    happening: Happening
    subject: object


Notice: TypeAlias = "tuple[Happening, object]"
Listener: TypeAlias = Callable[[Notice], object]
"""Takes what has happened, in order. Never waits."""


class Reporter:
    """Passes on what a session reports, to one listener. One thread at a time may use it."""

    _session: Session
    _listener: Listener | None = None

    def listen(self, listener: Listener, happening: Happening) -> None:
        """Report to `listener` what happens from now on; of `happening` also what is so already."""
        self._listener = listener
        standing = self._session.standing_notice(happening)
        if standing is not None:
            listener(standing)

    def _tell_listener(self) -> None:
        notices = self._session.notices
        while notices:
            happened = notices.popleft()
            if self._listener is not None:
                self._listener(happened)
