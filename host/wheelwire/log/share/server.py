"""Offers a link to other programs of this computer: they may look, stop and e-stop, never drive.

The port's owner alone drives, sets and clears. What crosses the link is copied for each attached
program by a thread of its own; the link's thread only appends to a queue, whoever listens.
"""

from __future__ import annotations

import dataclasses
import errno
import json
import logging
import os
import select
import socket
import stat
import struct
import threading
import time
import weakref
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, cast

from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.types import READ_ONLY, AnyMessage, Estop, SensorStream, Stop

from ...errors import InvalidCommand, LinkLost, WheelwireError
from ...link.clock import host_clock_us
from ...link.ports import device_of
from ...link.programs import (
    SUFFIX,
    SharingFolder,
    note_driver,
    process_name,
    program_name,
    sharing_folder,
)
from ...link.requests import Answer, Done, RequestMessage
from ...link.threads import Notifier, WakeUp, abandon_in_child, start_without_waiting
from ...link.traffic import STOP_ASKED, TrafficReader
from .wire import (
    VERSION,
    MessageReader,
    Say,
    encoded_error,
    encoded_records,
    message,
    tagged,
    take_tag,
)

if TYPE_CHECKING:
    from ...link.connection import Link

COPY_S = 0.02
"""How often records are copied to those who listen."""
LOOK_S = 1.0
"""How often the socket's file and the board's identity are looked at."""
QUEUE = 5000
"""Records that wait for one attached program: more than a second of a link at 1 kHz."""
MAX_PROGRAMS = 16
MAX_REQUESTS = 4
"""Unanswered requests of one program at most: the owner's requests wait behind them."""
LONGEST_REQUEST = 1024
MANY = 32
"""Requests that came together: a program that sends more is given a rest."""
LONGEST_REST_S = 0.02
BACKLOG = 1 << 20
"""Bytes that wait for a program that does not read them; with more it is cut off."""
NAMES = 8
"""Boards with the same identity on one computer: simulated ones."""
CLOSE_TIMEOUT_S = 1.0

_CREDENTIALS = struct.Struct("3i")
_log = logging.getLogger("wheelwire.share")


class SharingServer:
    """Offers one link, from `start` to its end.

    Args:
        link: Referred to weakly: whoever is attached keeps no robot alive.
    """

    def __init__(self, link: Link) -> None:
        self._link = weakref.ref(link)
        self._wake_up = WakeUp()
        self._changed = Notifier()
        self._finishing = self._has_ended = False
        self._place = _Place()
        self._programs: dict[int, _Program] = {}
        """By the descriptor of its connection."""
        self._look_s = 0.0
        self._stops = AttachedStops(self._post_stop, self._wake_up.wake)
        self._askers: list[str] = []
        """Who has asked for a stop that was not sent yet."""
        self._poller = select.poll()
        self._poller.register(self._wake_up, select.POLLIN)
        self._thread = threading.Thread(target=self._run, name="wheelwire share", daemon=True)
        abandon_in_child(self)

    def start(self) -> None:
        """Begin to offer the link. Never waits, and a failure is only logged."""
        start_without_waiting(self._thread, self._give_up)

    def finish(self) -> None:
        """Pass on what is left until the link has ended, and end; without waiting."""
        self._finishing = True
        self._wake_up.wake()

    def close(self) -> None:
        """As `finish`, and wait for it: the link has ended."""
        self.finish()
        if threading.current_thread() is self._thread:
            return
        # As in `Link.close`: not join() alone, which an exception out of a handler may cut short.
        ended = self._changed.wait_for(lambda: self._has_ended, CLOSE_TIMEOUT_S)
        if ended and self._thread.is_alive():
            self._thread.join(CLOSE_TIMEOUT_S)

    def abandon(self) -> None:
        """This process was forked: the parent goes on with what is open."""
        self._place.abandon()
        self._release()

    # --- the thread ----------------------------------------------------------------------------

    def _give_up(self, error: RuntimeError) -> None:
        _log.warning("other programs cannot look at this robot: %s", error)
        self._release()

    def _run(self) -> None:
        try:
            while self._work(self._wait()):
                pass
        except Exception:
            # Whatever it is, it must not become an error of whoever drives.
            _log.exception("sharing has failed: other programs cannot look at this robot any more")
        finally:
            self._place.close()
            self._release()

    def _release(self) -> None:
        for program in self._programs.values():
            program.connection.close()
        self._programs.clear()
        self._wake_up.close()
        self._has_ended = True
        self._changed.notify_all()

    def _wait(self) -> list[int]:
        """Wait until there is something to do; returns the descriptors that have something."""
        now_s = time.monotonic()
        # By the clock, not woken by the link: its thread has no time for others.
        is_copying = self._finishing or any(one.is_busy for one in self._programs.values())
        wait_s = COPY_S if is_copying else max(0.0, self._look_s - now_s)
        stop_due_s = self._stops.due_s()
        if stop_due_s is not None:
            wait_s = min(wait_s, max(0.0, stop_due_s - now_s))
        ready = [descriptor for descriptor, _ in self._poller.poll(wait_s * 1000)]
        if self._wake_up.fileno() in ready:
            self._wake_up.drain()
        return ready

    def _work(self, ready: list[int]) -> bool:
        """Do what there is to do; False once the link has ended."""
        link = self._link()
        if link is None:
            return False
        # First: what crosses the link before its end is passed on below.
        has_ended = link.has_ended
        # First of all what was asked: it may be an e-stop.
        begin_s, asked = time.monotonic(), 0
        for descriptor in ready:
            program = self._programs.get(descriptor)
            if program is None:
                continue
            before = program.asked
            if not program.read(link, self._ask_to_stop):
                self._drop(program, link)
            asked = max(asked, program.asked - before)
        now_s = time.monotonic()
        self._stops.advance(now_s)
        is_second = now_s >= self._look_s
        if is_second:
            self._look_s = now_s + LOOK_S
            self._look(link)
        if self._place.listener is not None and self._place.listener.fileno() in ready:
            self._accept(link, self._place.listener)
        for program in list(self._programs.values()):
            if not program.write(link, with_status=is_second):
                self._drop(program, link)
        if asked > MANY:
            # The owner's threads share the interpreter with this one, and need it to drive.
            time.sleep(min(LONGEST_REST_S, 2 * (time.monotonic() - begin_s)))
        return not has_ended

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

    def _look(self, link: Link) -> None:
        """Offer the link under its board's name, again if the file is gone."""
        place, board_id = self._place, link.info.device.board_id
        if link.arms:
            place.note_driver(board_id, link.session_id)
        if place.is_at(board_id):
            return
        if place.listener is not None:
            self._poller.unregister(place.listener)
            place.close()
        place.take(board_id)
        if place.listener is not None:
            self._poller.register(place.listener, select.POLLIN)

    def _accept(self, link: Link, listener: socket.socket) -> None:
        try:
            connection, _ = listener.accept()
        except OSError:  # whoever it was is gone, or no descriptor is left
            return
        if len(self._programs) >= MAX_PROGRAMS or not self._place.admits(connection):
            connection.close()
            return
        connection.setblocking(False)
        self._programs[connection.fileno()] = _Program(connection, link, self._wake_up.wake)
        self._poller.register(connection, select.POLLIN)

    def _drop(self, program: _Program, link: Link) -> None:
        descriptor = program.connection.fileno()
        self._poller.unregister(descriptor)
        del self._programs[descriptor]
        program.leave(link)


def offer(link: Link) -> SharingServer | None:
    """Begin to offer an open link; None if there is no room for it, which is logged."""
    try:
        server = SharingServer(link)
    except OSError as error:
        _log.warning("other programs cannot look at this robot: %s", error)
        return None
    server.start()
    return server


class _Place:
    """The socket's file.

    Attributes:
        listener: The socket; None while the link cannot be offered.
    """

    def __init__(self) -> None:
        self.listener: socket.socket | None = None
        self._board_id = ""
        self._directory: SharingFolder | None = None
        self._path = Path()
        self._identity: tuple[int, ...] = ()
        self._problem = ""
        self._session_id = 0

    def is_at(self, board_id: str) -> bool:
        """Whether the link is offered under the name of this board."""
        return self.listener is not None and board_id == self._board_id and self._is_there()

    def note_driver(self, board_id: str, session_id: int) -> None:
        """Remember that this program drives the board; a failure costs that alone."""
        if session_id in (0, self._session_id):
            return
        with suppress(OSError, WheelwireError):
            note_driver(sharing_folder(make=True), board_id, session_id)
        self._session_id = session_id

    def take(self, board_id: str) -> None:
        """Offer the link under the name of this board; a failure is logged."""
        try:
            self._directory = sharing_folder(make=True)
            with self._directory.locked():
                self._bind(board_id, self._directory)
        except (OSError, WheelwireError) as error:
            # Once: it is tried again each second.
            if not self._problem:
                self._problem = str(error)
                _log.warning("other programs cannot look at this robot: %s", error)
        else:
            self._board_id, self._problem = board_id, ""

    def _bind(self, board_id: str, directory: SharingFolder) -> None:
        for number in range(1, NAMES + 1):
            suffix = SUFFIX if number == 1 else f"-{number}{SUFFIX}"
            path = directory.path / f"{board_id}{suffix}"
            if _is_taken(path):
                continue
            # Named once it listens: who finds a name that refuses takes the robot for free.
            unnamed = path.with_name(f"{path.name}.new")
            unnamed.unlink(missing_ok=True)  # of a program that was killed in here
            listener = socket.socket(socket.AF_UNIX)
            try:
                listener.bind(str(unnamed))
                # Before it listens, so that nobody gets in meanwhile.
                if directory.group is not None:
                    os.chown(unnamed, -1, directory.group)
                unnamed.chmod(0o600 if directory.group is None else 0o660)
                listener.setblocking(False)
                listener.listen(MAX_PROGRAMS)
                unnamed.rename(path)
            except BaseException:
                listener.close()
                raise
            self.listener, self._path, self._identity = listener, path, _identity(path)
            return
        raise OSError(errno.EADDRINUSE, f"{NAMES} programs offer a board of the same identity")

    def admits(self, connection: socket.socket) -> bool:
        """Whether the program at the other end may use it."""
        if self._directory is not None and self._directory.group is not None:
            return True  # by the mode of the file
        return _credentials(connection)[1] in (0, os.getuid())

    def close(self) -> None:
        """Remove the file, unless it is another program's by now."""
        directory = self._directory
        if self.listener is None or directory is None:
            return
        self.abandon()
        # The folder may be gone.
        with suppress(OSError), directory.locked():
            if self._is_there():
                self._path.unlink()

    def abandon(self) -> None:
        """Close the socket, and leave the file."""
        if self.listener is not None:
            self.listener.close()
            self.listener = None

    def _is_there(self) -> bool:
        try:
            return _identity(self._path) == self._identity
        except OSError:
            return False


def _identity(path: Path) -> tuple[int, ...]:
    found = path.lstat()
    # The number of a file that was removed may be given to the next; not at the same moment.
    return found.st_dev, found.st_ino, found.st_mtime_ns


def _is_taken(path: Path) -> bool:
    """Whether a running program has this socket; what a killed one has left is removed."""
    try:
        if not stat.S_ISSOCK(path.lstat().st_mode):
            return True
    except FileNotFoundError:
        return False
    with socket.socket(socket.AF_UNIX) as probe:
        probe.setblocking(False)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return False
        except OSError:  # its queue is full, or it is another user's
            return True
    return True


class _Program:
    """One attached program, which first hears who holds the port.

    Args:
        connection: To it; `leave` closes it.
        link: That is offered.
        wake: Has the server write what there is to say.
    """

    def __init__(self, connection: socket.socket, link: Link, wake: Callable[[], None]) -> None:
        self.connection = connection
        pid = _credentials(connection)[0]
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
        self._output = bytearray(VERSION)
        self._output += message(Say.GREETING, json.dumps(greeting).encode())
        self._records: TrafficReader | None = None
        """Those that it has not been given yet; None if it does not listen."""
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

        `stop` takes a stop, with the name of who asks, to be merged with those of others.
        """
        try:
            data = self.connection.recv(4096)
            for kind, payload in self._reader.feed(data):
                if kind is Say.ASK:
                    self.asked += 1
                    self._ask(link, stop, *take_tag(payload))
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
        self._output += message(Say.STATUS, json.dumps(status).encode())

    def write(self, link: Link, *, with_status: bool) -> bool:
        """Write what it takes of what there is; False once it is gone, or reads nothing."""
        former: Answer | WheelwireError | None = None
        while self._results:
            tag, result = self._results.popleft()
            self._waiting.pop(tag, None)
            if result is not former:  # stops that were merged have the same one
                former, (kind, data) = result, _encoded(result)
            self._output += tagged(kind, tag, data)
        # While it has not read what it was given, its records wait where the oldest fall out.
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
            self._output += message(Say.LOST, struct.pack("<I", min(records.lost, 0xFFFF_FFFF)))
            self._listen(link)
        elif taken:
            self._output += message(Say.RECORDS, encoded_records(taken))

    def leave(self, link: Link) -> None:
        """It is gone, or is sent away: nothing more is asked for it, but a stop goes out."""
        self.connection.close()
        self._end_listening(link)
        for done in self._waiting.values():
            link.withdraw(done)


def _only_begins(asked: AnyMessage, link: Link) -> bool:
    """Whether it asks for the sensors' samples of a robot of which nobody has asked for any."""
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
        return Say.FAILURE, encoded_error(result)
    return Say.ANSWER, encode_frame(result, 0)


def _note_asked(link: Link, by: str) -> None:
    """`wheelwire why` names who asked for a stop."""
    link.note({STOP_ASKED: {"by": by, "host_us": host_clock_us()}})


def _credentials(connection: socket.socket) -> tuple[int, int]:
    """Process and user at the other end."""
    data = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    pid, user, _ = _CREDENTIALS.unpack(data)
    return pid, user


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
        """When `advance` has something to do; None while nobody waits to be sent."""
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
