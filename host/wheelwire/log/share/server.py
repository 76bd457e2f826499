"""Serves the programs that are attached to a link: they may look, stop and e-stop, never drive.

The thread of `link.sharing` copies what crosses the link for each of them. The link's own thread
only appends to a queue, however many listen.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import select
import socket
import struct
import time
import weakref
from collections import deque
from collections.abc import Callable
from functools import lru_cache, partial
from typing import TYPE_CHECKING, TypeAlias, cast

from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.types import READ_ONLY, AnyMessage, Estop, SensorStream, Stop

from ...errors import InvalidCommand, LinkLost, WheelwireError
from ...link.clock import host_clock_us
from ...link.ports import device_of
from ...link.program_names import process_name, program_name
from ...link.requests import Answer, Done, RequestMessage
from ...link.sharing import COPY_S, MAX_PROGRAMS, credentials
from ...link.traffic import STOP_ASKED, TrafficReader
from . import wire
from .wire import MessageReader, Say

if TYPE_CHECKING:
    from ...link.connection import Link

QUEUE = 5000
"""Records that wait for one attached program: more than a second of a link at 1 kHz."""
MAX_REQUESTS = 4
"""Unanswered requests of one program at most: the owner's requests wait behind them."""
LONGEST_REQUEST = 1024
BACKLOG = 1 << 20
"""Bytes that wait for a program that does not read them; with more it is cut off."""


class AttachedPrograms:
    """The programs that are attached to one link. One thread calls this.

    Args:
        link: A weak reference: attached programs must not keep the robot alive.
        poller: Wakes the thread when one of them sends something.
        wake: Wakes the thread.
    """

    def __init__(
        self, link: weakref.ref[Link], poller: select.poll, wake: Callable[[], None]
    ) -> None:
        self._link = link
        self._poller = poller
        self._wake = wake
        self._programs: dict[int, _Program] = {}
        """Attached programs, by the descriptor of their connections."""
        self._stops = AttachedStops(self._post_stop, wake)
        self._askers: list[str] = []
        """The programs that asked for a stop that was not sent yet."""

    def add(self, connection: socket.socket, link: Link) -> None:
        """One has attached; closes the connection if there are too many."""
        if len(self._programs) >= MAX_PROGRAMS:
            connection.close()
            return
        connection.setblocking(False)
        self._programs[connection.fileno()] = _Program(connection, link, self._wake)
        self._poller.register(connection, select.POLLIN)

    def close(self) -> None:
        """Close all connections."""
        for program in self._programs.values():
            program.connection.close()
        self._programs.clear()

    def longest_wait_s(self, now_s: float) -> float:
        """How long the thread may wait until something is to be written or sent."""
        # At fixed times: the link's thread has no time to wake this one.
        wait_s = COPY_S if any(one.is_busy for one in self._programs.values()) else math.inf
        stop_due_s = self._stops.due_s()
        return wait_s if stop_due_s is None else min(wait_s, max(0.0, stop_due_s - now_s))

    def read(self, link: Link, ready: list[int]) -> int:
        """Do what was asked by those with something to read; how many requests one has sent."""
        asked = 0
        for descriptor in ready:
            program = self._programs.get(descriptor)
            if program is None:
                continue
            before = program.asked
            if not program.read(link, self._ask_to_stop):
                self._drop(program, link)
            asked = max(asked, program.asked - before)
        self._stops.advance(time.monotonic())
        return asked

    def write(self, link: Link, *, with_status: bool) -> None:
        """Write to each what there is for it."""
        for program in list(self._programs.values()):
            if not program.write(link, with_status=with_status):
                self._drop(program, link)

    def _ask_to_stop(self, name: str, done: Done) -> None:
        if name not in self._askers:
            self._askers.append(name)
        self._stops.ask(done)

    def _post_stop(self, done: Done) -> None:
        link, askers, self._askers = self._link(), self._askers, []
        if link is None:
            raise LinkLost("the link has ended")
        link.post_stop_for_attached(done)
        _note_asked(link, " and ".join(askers))

    def _drop(self, program: _Program, link: Link) -> None:
        descriptor = program.connection.fileno()
        self._poller.unregister(descriptor)
        del self._programs[descriptor]
        program.leave(link)


class _Program:
    """One attached program, which is first sent the holder of the port.

    Args:
        connection: To it; `leave` closes it.
        link: That is offered.
        wake: Has the server write what there is to say.
    """

    def __init__(self, connection: socket.socket, link: Link, wake: Callable[[], None]) -> None:
        self.connection = connection
        pid = credentials(connection)[0]
        self._name = process_name(pid)
        self._wake = wake
        self._reader = MessageReader(LONGEST_REQUEST)
        self.asked = 0
        """How many requests have come."""
        greeting = {
            "board_id": link.info.device.board_id,
            "identity": device_of(link.identity),
            "port": link.name if "://" in link.name else device_of(link.name),
            "pid": os.getpid(),
            "program": program_name(os.getpid()),
        }
        self._output = bytearray(wire.VERSION)
        self._output += wire.message(Say.GREETING, json.dumps(greeting).encode())
        self._records: TrafficReader | None = None
        """The records not yet passed to it; None if it does not listen."""
        self._waiting: dict[int, Done] = {}
        """Its unanswered requests, by tag."""
        self._results: deque[tuple[int, Answer | WheelwireError]] = deque()
        """The link's thread appends to it."""

    @property
    def is_busy(self) -> bool:
        """Whether there will soon be something to write though nothing comes."""
        return self._records is not None or bool(self._output)

    def read(self, link: Link, stop: Callable[[str, Done], None]) -> bool:
        """Read and do what it asks for; False once it is gone, or talks nonsense.

        `stop` takes a stop, with the asking program's name, to be merged with other stops.
        """
        try:
            data = self.connection.recv(4096)
            for kind, payload in self._reader.feed(data):
                if kind is Say.ASK:
                    self.asked += 1
                    self._ask(link, stop, *wire.take_tag(payload))
                elif kind is Say.LISTEN:
                    self._listen(link)
                    self._say_status(link)
                else:
                    return False
        except BlockingIOError:
            return True
        except (OSError, ValueError):
            return False
        return bool(data)

    def _ask(self, link: Link, stop: Callable[[str, Done], None], tag: int, frame: bytes) -> None:
        if tag in self._waiting:  # its requests are counted by their tags
            raise ValueError("a tag that is under way")
        asked = _decoded(frame)
        done = partial(self._take_result, tag)
        try:
            if isinstance(asked, Stop):
                # Its mode is the owner's affair. The result comes in this thread.
                stop(self._name, partial(self._keep_result, tag))
            elif isinstance(asked, Estop):
                link.post_stop(done, None)
                # After the e-stop, which is not to wait.
                _note_asked(link, self._name)
            # Sensors are measured in any case, so any program may be the first to ask for samples.
            elif not isinstance(asked, READ_ONLY) and not _only_begins(asked, link):
                raise InvalidCommand(
                    f"{type(asked).__name__}: a program that is attached reads, stops and "
                    f"e-stops; only {process_name(os.getpid())}, which holds "
                    f"{link.name}, drives, sets and clears"
                )
            elif len(self._waiting) >= MAX_REQUESTS:
                raise InvalidCommand(f"wait for an answer: {MAX_REQUESTS} requests are under way")
            else:
                self._waiting[tag] = done
                link.post(cast("RequestMessage", asked), done)
        except WheelwireError as error:
            done(error)

    def _take_result(self, tag: int, result: Answer | WheelwireError) -> None:
        """Called by the link's thread."""
        self._keep_result(tag, result)
        self._wake()

    def _keep_result(self, tag: int, result: Answer | WheelwireError) -> None:
        self._results.append((tag, result))

    def _listen(self, link: Link) -> None:
        """Begin, or begin again, with the session as it is now."""
        self._end_listening(link)
        self._records = TrafficReader(QUEUE)
        link.listen_to_traffic(self._records)

    def _end_listening(self, link: Link) -> None:
        if self._records is not None:
            link.leave_traffic(self._records)
            self._records = None

    def _say_status(self, link: Link) -> None:
        info = link.info
        status = {
            "port": info.port,
            "baud_rate": info.baud_rate,
            "low_latency": info.low_latency,
            "statistics": dataclasses.asdict(link.statistics),
        }
        self._output += wire.message(Say.STATUS, json.dumps(status).encode())

    def write(self, link: Link, *, with_status: bool) -> bool:
        """Write what it takes of what there is; False once it is gone, or reads nothing.

        Also if the link gives it nothing: then it learns so, at once.
        """
        former: Answer | WheelwireError | None = None
        while self._results:
            tag, result = self._results.popleft()
            self._waiting.pop(tag, None)
            if result is not former:  # stops that were merged have the same one
                former, (kind, data) = result, _encoded(result)
            self._output += wire.tagged(kind, tag, data)
        # While it has not read what it was given, its records wait where the oldest fall out.
        if self._records is not None and self._records.failure is not None:
            return False
        if self._records is not None and not self._output:
            self._copy(link, self._records)
            if with_status:
                self._say_status(link)
        if not self._output:
            return True
        try:
            del self._output[: self.connection.send(self._output)]
        except BlockingIOError:
            pass
        except OSError:
            return False
        return len(self._output) <= BACKLOG

    def _copy(self, link: Link, records: TrafficReader) -> None:
        taken = records.take()
        if records.lost:
            # What comes after a gap cannot be done again from what came before it.
            self._output += wire.message(
                Say.LOST, struct.pack("<I", min(records.lost, 0xFFFF_FFFF))
            )
            self._listen(link)
        elif taken:
            self._output += wire.message(Say.RECORDS, wire.encoded_records(taken))

    def leave(self, link: Link) -> None:
        """It is gone, or is sent away: nothing more is asked for it, but a stop goes out."""
        self.connection.close()
        self._end_listening(link)
        for done in self._waiting.values():
            link.withdraw(done)


def _only_begins(asked: AnyMessage, link: Link) -> bool:
    """Whether it asks for sensor samples that no program has asked this robot for yet."""
    return isinstance(asked, SensorStream) and asked.rate_hz > 0 and link.sensors.rate_hz == 0


@lru_cache(maxsize=64)
def _decoded(frame: bytes) -> AnyMessage:
    """The one message in a frame; of a flood each is the same."""
    messages = Decoder().feed(frame)
    if len(messages) != 1:
        raise ValueError("a request that is not one frame")
    return messages[0]


def _encoded(result: Answer | WheelwireError) -> tuple[Say, bytes]:
    if isinstance(result, WheelwireError):
        return Say.FAILURE, wire.encoded_error(result)
    return Say.ANSWER, encode_frame(result, 0)


def _note_asked(link: Link, by: str) -> None:
    """So that `wheelwire why` can name the program that asked for a stop."""
    link.note({STOP_ASKED: {"by": by, "host_us": host_clock_us()}})


PERIOD_S = 0.02
"""Between two of them at the least: a flood must not fill the line, on which the owner drives."""

_Result: TypeAlias = "Answer | WheelwireError"


class AttachedStops:
    """Merges stops. One thread calls it; only `_answered` is another's, the link's.

    Args:
        post: Sends a stop, and has its argument called with the result.
        wake: Has the thread of this call `advance` soon.
    """

    def __init__(self, post: Callable[[Done], None], wake: Callable[[], None]) -> None:
        self._post = post
        self._wake = wake
        self._waiting: list[Done] = []
        self._under_way: list[Done] = []
        self._results: deque[_Result] = deque()
        self._next_s = 0.0

    def ask(self, done: Done) -> None:
        """Stop the robot, now or with the next stop; `done` is called with that one's result."""
        self._waiting.append(done)

    def due_s(self) -> float | None:
        """When `advance` has something to do; None while nothing waits to be sent."""
        return self._next_s if self._waiting and not self._under_way else None

    def advance(self, now_s: float) -> None:
        """Answer those whose stop was answered, and send the next stop if it is due."""
        while self._results:
            answered, self._under_way = self._under_way, []
            result = self._results.popleft()
            for done in answered:
                done(result)
        due_s = self.due_s()
        if due_s is None or now_s < due_s:
            return
        self._under_way, self._waiting = self._waiting, []
        self._next_s = now_s + PERIOD_S
        try:
            self._post(self._answered)
        except WheelwireError as error:
            self._results.append(error)
            self._wake()

    def _answered(self, result: _Result) -> None:
        self._results.append(result)
        self._wake()
