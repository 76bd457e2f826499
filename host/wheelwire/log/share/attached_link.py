"""A link through the program that holds the port: it reads, stops and e-stops, but never drives.

That program passes on what crosses its link (`server`). From this, the attached link runs the
session again, so a caller can read everything that it could read from a link.
"""

from __future__ import annotations

import logging
import select
import socket
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, NoReturn, cast

from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import encode_frame
from wheelwire_protocol.types import Estop, Stop

from ...errors import InvalidCommand, LinkClosed, LinkLost, RequestTimeout, WheelwireError
from ...link.connection import CONNECT_TIMEOUT_S
from ...link.device_link import CALL_TIMEOUT_S
from ...link.info import LinkInfo
from ...link.ports import device_of
from ...link.requests import Answer, Done, RequestMessage
from ...link.sample_stream import LatestSample
from ...link.sharing_folder import SUFFIX, sharing_folders
from ...link.statistics import LinkStatistics
from ...link.traffic import Kind, Record, Traffic, TrafficReader
from ..rerun import RerunLink
from . import wire
from .wire import MessageReader, Say

GREETING_S = 3.0
"""How long a program has to say what it holds; a busy computer takes a while. A suspended program
never answers."""
LONGEST_MESSAGE = 1 << 24
CLOSED = "the link is closed; open it again"

_log = logging.getLogger("wheelwire")


@dataclass
class Holder:
    """A program that holds a port, and the connection to it.

    Attributes:
        name: For messages: `python3, process 4711`.
        identity: The robot's port, or the name used in its place.
        port: The port that it holds, for messages.
        board_id: The id of the board at the port.
    """

    name: str
    identity: str
    port: str
    board_id: str
    connection: socket.socket
    reader: MessageReader
    rest: list[tuple[Say, bytes]]
    """The messages that came behind the greeting."""


def find_holder(identity: str, board_id: str | None = None) -> Holder | None:
    """The program that holds this robot, or this board; None if no program does.

    The caller closes `Holder.connection`, or the link that it makes of it.

    Args:
        identity: A port, or the name used in its place (`LinkOptions.identity`).
        board_id: The id of the board; the identity is then ignored.
    """
    wanted = device_of(identity)
    for holder in _holders(board_id or ""):
        if holder.board_id == board_id if board_id else holder.identity == wanted:
            return holder
        holder.connection.close()
    return None


def _holders(board_id: str) -> Iterator[Holder]:
    """All programs that offer a link, or those whose socket has this board's name.

    Programs that answer first come first, so that a suspended one does not hide the others.
    """
    paths: list[Path] = []
    for folder in sharing_folders():
        with suppress(OSError):  # it has just been removed
            paths += sorted(folder.path.glob(f"{board_id}*{SUFFIX}"))
    connections = [one for one in map(_connect, paths) if one is not None]
    asked = {one.fileno(): one for one in connections}
    poller = select.poll()
    for descriptor in asked:
        poller.register(descriptor, select.POLLIN)
    end_s = time.monotonic() + GREETING_S
    try:
        while asked and (left_s := end_s - time.monotonic()) > 0:
            for descriptor, _ in poller.poll(left_s * 1000):
                poller.unregister(descriptor)
                holder = _greeted(asked.pop(descriptor))
                if holder is not None:
                    yield holder
    finally:
        for connection in asked.values():
            connection.close()


def _connect(path: Path) -> socket.socket | None:
    connection = socket.socket(socket.AF_UNIX)
    try:
        connection.settimeout(GREETING_S)
        connection.connect(str(path))
        connection.sendall(wire.VERSION)
    except OSError:  # it was killed, or is ending
        connection.close()
        return None
    return connection


def _greeted(connection: socket.socket) -> Holder | None:
    try:
        reader = MessageReader(LONGEST_MESSAGE)
        messages: list[tuple[Say, bytes]] = []
        while not messages:
            data = connection.recv(4096)
            if not data:
                raise ConnectionError
            messages = reader.feed(data)
        known = wire.decoded_json(messages.pop(0)[1])
        name = f"{known['program']}, process {known['pid']}"
        robot = known["identity"], known["port"], known["board_id"]
        return Holder(name, *robot, connection, reader, messages)
    except (OSError, ValueError, KeyError):  # it is ending, or of another release
        connection.close()
        return None


class AttachedLink(RerunLink):
    """A link held by another program.

    Args:
        latest_sample: Takes the samples.
        holder: That program; its connection is closed with this link.
        listens: Whether to receive what crosses the link; a stop does not need it.

    Attributes:
        lost: How many records this program was too slow to take; after each loss it took over the
            session again.
    """

    def __init__(
        self, latest_sample: LatestSample, holder: Holder, *, listens: bool = True
    ) -> None:
        super().__init__(latest_sample)
        self.holder = holder
        self.lost = 0
        self._listens = listens
        self._status: dict[str, Any] | None = None
        self._tags = count(1)
        self._asked: dict[int, Done] = {}
        self._traffic = Traffic()
        self._joining: list[TrafficReader] = []
        """The readers that get all records from the next START on."""
        self._thread = threading.Thread(
            target=self._run, name=f"wheelwire attached to {holder.port}", daemon=True
        )

    # --- opening and closing -------------------------------------------------------------------

    def open(self) -> None:
        """Begin to listen, and wait until the state of the session is known.

        Raises:
            LinkLost: The program says nothing.
        """
        self.holder.connection.settimeout(None)
        self._thread.start()
        if not self._listens:
            return
        try:
            self._send(wire.message(Say.LISTEN))
            self.changed.wait_for(self._is_known, CONNECT_TIMEOUT_S)
            self._check_known()
        except BaseException:
            self.close()
            raise

    def _is_known(self) -> bool:
        known = self._rerun.session is not None and self._status is not None
        return known or self._end is not None

    def _check_known(self) -> None:
        self._check_alive()
        if not self._is_known():
            raise LinkLost(
                f"{self.holder.name}, which holds {self.name}, says nothing: end that program, or "
                "try again when it is less busy"
            )

    def finish(self) -> None:
        """Begin to close, without waiting."""
        self._finish(LinkClosed(CLOSED))

    def close(self) -> None:
        """Close the connection; the other program goes on driving. Safe to call more than once."""
        self.finish()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._thread.join(CALL_TIMEOUT_S)
        self.holder.connection.close()

    def _finish(self, end: LinkClosed) -> None:
        if self._end is not None:
            return
        self._end = end
        with suppress(OSError):  # the other side was faster
            self.holder.connection.shutdown(socket.SHUT_RDWR)
        with ExitStack() as last:  # all of it happens, in the opposite order, though a part fails
            last.callback(self.changed.notify_all)
            last.callback(self._latest_sample.fail, end)
            for tag in tuple(self._asked):
                last.callback(self._answer, tag, end)

    # --- what comes ----------------------------------------------------------------------------

    def _run(self) -> None:
        """Take what the other program says, until it ends: the thread's main function."""
        holder, end = self.holder, self._gone
        try:
            messages = holder.rest
            while True:
                for kind, data in messages:
                    self._take(kind, data)
                received = holder.connection.recv(1 << 16)
                if not received:
                    break
                messages = holder.reader.feed(received)
        except OSError:
            pass  # as if it had closed the connection
        except ValueError as error:
            end = f"{holder.name} holds {self.name} and cannot be understood ({error}): " + (
                "use one release of Wheelwire in both programs"
            )
        except Exception as error:  # no caller may wait for a thread that is gone
            _log.exception("the thread of an attached robot failed")
            end = f"following {holder.name} failed ({error!r}): report this, with the log"
        self._finish(LinkClosed(end))

    @property
    def _gone(self) -> str:
        return f"{self.holder.name}, which held {self.name}, has ended or closed it: run this again"

    def _take(self, kind: Say, data: bytes) -> None:
        if kind is Say.RECORDS:
            for record in wire.decoded_records(data):
                self._do_again(record)
            self._latest_sample.notify_all()
        elif kind is Say.STATUS:
            self._status = wire.decoded_json(data)
            self.changed.notify_all()
        elif kind is Say.ANSWER:
            tag, frame = wire.take_tag(data)
            for answer in Decoder().feed(frame):
                self._answer(tag, cast("Answer", answer))
        elif kind is Say.FAILURE:
            tag, error = wire.take_tag(data)
            self._answer(tag, wire.decoded_error(error))
        elif kind is Say.LOST:
            self.lost += wire.take_tag(data)[0]

    def _do_again(self, record: Record) -> None:
        traffic = self._traffic
        if record.kind is Kind.START:
            while self._joining:
                traffic.readers = (*traffic.readers, self._joining.pop())
        for reader in traffic.readers:
            reader.append(record)
        super()._do_again(record)
        if record.kind is Kind.START:  # with another device, perhaps
            self.changed.notify_all()

    def _answer(self, tag: int, result: Answer | WheelwireError) -> None:
        done = self._asked.pop(tag, None)
        if done is not None:
            done(result)

    # --- what is known ---------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The port."""
        return self.holder.port

    @property
    def info(self) -> LinkInfo:
        """Port, baud rate and device."""
        device, status = self._device, self._status or {}
        return LinkInfo(
            status.get("port", self.name),
            status.get("baud_rate"),
            status.get("low_latency"),
            device,
            self.reported.board,
            self.reported.copies_lost,
        )

    @property
    def statistics(self) -> LinkStatistics:
        """What the other program has counted since it opened the link; a second old at most."""
        return LinkStatistics(**(self._status or {}).get("statistics", {}))

    @property
    def traffic(self) -> Traffic:
        """Passes on what the other program says of its link, under the same numbers."""
        return self._traffic

    def note(self, what: Mapping[str, Any]) -> None:
        """Do nothing: the notes and the recording belong to the other program."""

    def listen_to_traffic(self, reader: TrafficReader) -> None:
        """As `Link.listen_to_traffic`; records that this program takes too late are missing."""
        self._joining.append(reader)
        self._send(wire.message(Say.LISTEN))

    def leave_traffic(self, reader: TrafficReader) -> None:
        """`reader` gets nothing more."""
        with suppress(ValueError):
            self._joining.remove(reader)
        self._traffic.remove(reader)

    # --- what is asked for -----------------------------------------------------------------------

    def post(self, message: RequestMessage, done: Done) -> None:
        """As `Link.post`; an `InvalidCommand` for what changes something."""
        self._ask(message, done)

    def post_stop(self, done: Done, mode: StopMode | None = StopMode.CONFIGURED) -> None:
        """As `Link.post_stop`. The next setpoint of the other program drives, unless it latched.

        Any other `mode` than None is the configured one: how that program's robot stops is its own.
        """
        self._ask(Estop(0, 0) if mode is None else Stop(0, 0, 0, StopMode.CONFIGURED), done)

    def withdraw(self, done: Done) -> None:
        """The caller no longer waits for `done`."""
        for tag in [tag for tag, one in self._asked.items() if one is done]:
            self._asked.pop(tag, None)

    def drive_velocity(self, left_mps: float, right_mps: float, expiry_us: int) -> NoReturn:  # noqa: ARG002
        """Refuse: the other program drives.

        Raises:
            InvalidCommand: Always.
        """
        raise InvalidCommand(
            f"{self.holder.name} holds {self.name} and alone drives, sets and clears; a program "
            "that is attached reads, stops and e-stops: end that one first to drive from here"
        )

    def drive_duty(self, left: float, right: float, expiry_us: int) -> NoReturn:
        """As `drive_velocity`."""
        self.drive_velocity(left, right, expiry_us)

    def _ask(self, asked: RequestMessage, done: Done) -> None:
        self._check_alive()
        tag = next(self._tags)
        self._asked[tag] = done
        self._send(wire.tagged(Say.ASK, tag, encode_frame(asked, 0)))

    def _send(self, data: bytes) -> None:
        # One call, all or nothing: any thread may send without a lock.
        try:
            self.holder.connection.sendall(data)
        except OSError:
            self._finish(LinkClosed(self._gone))
            self._check_alive()

    def refused_rate(self, rate_hz: int, error: InvalidCommand) -> InvalidCommand:  # noqa: ARG002
        """As `DeviceLink.refused_rate`; says which program can ask."""
        has = self.sensors.rate_hz
        asked = f"has requested its sensors at {has} Hz" if has else "has not requested them"
        return InvalidCommand(
            f"only the program that holds {self.name} can request its sensors at {rate_hz} Hz, "
            f"and {self.holder.name} {asked}: call `robot.sensors.start({rate_hz})` there, "
            "then this program gets the samples, too; or end that program and run this again"
        )

    def no_answer(self) -> RequestTimeout:
        """As `DeviceLink.no_answer`; says whose answer it is."""
        return RequestTimeout(
            f"{self.holder.name}, which holds {self.name}, gave no answer for "
            f"{CALL_TIMEOUT_S:g} s: it is unknown whether that was done; look at that program"
        )
