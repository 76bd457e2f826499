"""A session run again from what crossed its link: the same samples, counters and stamps.

`frames` finds the messages one by one; `Rerun` repeats the session; `RerunLink` is a link to it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import Hold, SetDuty, SetWheelVelocity

from ..errors import LinkLost, WheelwireError
from ..link.device_link import DeviceLink
from ..link.device_reports import DeviceReports
from ..link.handover import resumed
from ..link.requests import Answer
from ..link.sample_stream import LatestSample, Measurement
from ..link.session import Phase, Session
from ..link.setpoints import ASKED, Setpoint
from ..link.threads import Notifier
from ..link.traffic import ATTACHED, ESTOP, Kind, Record


class Frame(NamedTuple):
    """One message, and when its last byte crossed the link."""

    host_us: int
    """The host's monotonic clock, as in a sample's stamp."""
    is_sent: bool
    """Whether the host sent it."""
    message: Any


class FrameReader:
    """Finds the messages of both directions in a link's records."""

    def __init__(self) -> None:
        self._received = Decoder()
        self._sent = Decoder()

    @property
    def lost(self) -> int:
        """Received frames that are missing, by their sequence numbers."""
        return self._received.counters.seq_lost

    def feed(self, record: Record) -> Iterator[Frame]:
        """The messages that one record completes."""
        kind = record.kind
        # A frame that was cut by the loss of the port, or of records, has no rest.
        if kind in (Kind.START, Kind.CONNECTED):
            self._received.restart()
            self._sent.restart()
        elif kind in (Kind.RECEIVED, Kind.RECEIVED_EACH):
            for message in self._received.feed(record.data):
                yield Frame(record.host_us, False, message)
        elif kind is Kind.SENT:
            for message in self._sent.feed(record.data):
                yield Frame(record.host_us, True, message)


def frames(records: Iterable[Record]) -> Iterator[Frame]:
    """All messages of a recording, in order."""
    reader = FrameReader()
    for record in records:
        yield from reader.feed(record)


class Rerun:
    """Repeats what the session of a link did.

    Attributes:
        session: The session in its state after the newest record; None before a START. Only read
            it: what it wants to send goes nowhere.
        host_us: The recorded clock, of the newest record.
    """

    def __init__(self) -> None:
        self.session: Session | None = None
        self.host_us = 0
        self._do: dict[Kind, Callable[[Session, Record], object]] = {
            Kind.CONNECTED: lambda session, record: session.connect(record.host_us),
            Kind.DISCONNECTED: lambda session, record: session.disconnect(_lost(record)),
            Kind.RENEWED: lambda session, record: session.renew(_lost(record), record.host_us),
            Kind.NONCE: lambda session, record: session.use_nonce(_u32s(record)[0]),
            Kind.ADVANCED: lambda session, record: session.advance(record.host_us),
            Kind.REQUEST: _request,
            Kind.STOP: _stop,
            Kind.STOP_COPY: lambda session, record: session.setpoints.stop_copy(_mode(record)),
            Kind.VELOCITY: partial(_drive, SetWheelVelocity),
            Kind.DUTY: partial(_drive, SetDuty),
            Kind.WITHDRAWN: lambda session, record: session.withdraw_places(_u32s(record)),
            Kind.RELEASED: lambda session, _: session.release_trial(),
        }

    def feed(self, record: Record) -> list[Measurement]:
        """Run one record again; returns what it measured.

        Raises:
            ValueError: The record is from another release.
        """
        self.host_us = max(self.host_us, record.host_us)
        if record.kind is Kind.START:
            self.session = resumed(record.data, lambda: 0)
            return []
        session = self.session
        if session is None or record.kind in (Kind.SENT, Kind.NOTE):
            return []
        if record.kind is Kind.RECEIVED or record.kind is Kind.RECEIVED_EACH:
            each = record.kind is Kind.RECEIVED_EACH
            measured = session.receive(record.data, record.host_us, every_state=each)
        else:
            measured = []
            # What was raised at the time went to the application, and is raised again.
            with suppress(WheelwireError):
                try:
                    self._do[record.kind](session, record)
                except (struct.error, IndexError) as error:
                    raise ValueError(f"record {record.number} is damaged: {error}") from error
        session.take_output()
        return measured

    def feed_all(self, records: Iterable[Record]) -> list[Measurement]:
        """As `feed`, one after the other."""
        return [measured for record in records for measured in self.feed(record)]


def _request(session: Session, record: Record) -> None:
    for message in Decoder().feed(record.data):
        # A function for each, so that one can be withdrawn without the others.
        def done(_: Answer | WheelwireError) -> None:
            """Takes an answer that no call waits for."""

        session.request(message, done, record.host_us)  # type: ignore[arg-type]


def _stop(session: Session, record: Record) -> None:
    if record.data[0] == ATTACHED:
        session.stop_for_attached(_nobody, record.host_us)
    else:
        session.stop(_mode(record), _nobody, record.host_us)


def _nobody(_: Answer | WheelwireError) -> None:
    """Takes the answer to a recorded stop, which no call waits for."""


def _drive(kind: type[Setpoint], session: Session, record: Record) -> None:
    left, right, expiry_us = ASKED.unpack(record.data)
    session.setpoints.frame(kind, left, right, expiry_us, record.host_us)


def _mode(record: Record) -> StopMode | None:
    return None if record.data[0] == ESTOP else StopMode(record.data[0])


def _lost(record: Record) -> LinkLost:
    return LinkLost(record.data.decode("utf-8", "replace"))


def _u32s(record: Record) -> tuple[int, ...]:
    return struct.unpack(f"<{len(record.data) // 4}I", record.data)


class RerunLink(DeviceLink):
    """A link that follows records.

    Args:
        latest_sample: Takes the samples.

    Attributes:
        changed: Notified when the session opens or ends.
    """

    _end: WheelwireError | None = None

    def __init__(self, latest_sample: LatestSample) -> None:
        self.changed = Notifier()
        self._latest_sample = latest_sample
        self._rerun = Rerun()

    @property
    def _session(self) -> Session:  # type: ignore[override]
        session = self._rerun.session
        if session is None:
            self._check_alive()
            raise LinkLost(f"{self.name}: its session is not known yet; wait a moment")
        return session

    @property
    def reported(self) -> DeviceReports:  # type: ignore[override]
        """What the device has reported, as far as the records go."""
        return self._session.reported

    @property
    def _is_open(self) -> bool:
        session = self._rerun.session
        return session is not None and session.phase is Phase.OPEN

    @property
    def hold(self) -> Hold | None:
        """As `Session.hold`; None, too, while nothing is known of a session."""
        session = self._rerun.session
        return None if session is None else session.reported.hold

    def _do_again(self, record: Record) -> None:
        was_open = self._is_open
        for measurement in self._rerun.feed(record):
            self._latest_sample.put(measurement)
        session = self._rerun.session
        if session is not None:
            self._latest_sample.sensors.take(self.name, session.sensors.sensed)
        if was_open and not self._is_open:
            self._latest_sample.interrupt()
        if was_open is not self._is_open:
            self.changed.notify_all()
        if session is not None:
            self._tell_listener()
