"""Runs a session again from what its tap reported: the same samples, counters and stamps."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from contextlib import suppress

from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.decoder import Decoder

from ..errors import LinkLost, WheelwireError
from ..link.requests import Answer
from ..link.sample_stream import Measurement
from ..link.session import Session
from ..link.setpoints import ASKED
from ..link.traffic import ATTACHED, ESTOP, Kind, Record


class Rerun:
    """Repeats what the session of a tap did.

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
            Kind.VELOCITY: lambda session, record: session.setpoints.velocity_frame(
                *_asked(record)
            ),
            Kind.DUTY: lambda session, record: session.setpoints.duty_frame(*_asked(record)),
            Kind.WITHDRAWN: lambda session, record: session.withdraw_places(_u32s(record)),
            Kind.RELEASED: lambda session, _: session.release_trial(),
        }

    def feed(self, record: Record) -> list[Measurement]:
        """Run one record again; returns what it measured.

        Raises:
            ValueError: The record is none of this release.
        """
        self.host_us = max(self.host_us, record.host_us)
        if record.kind is Kind.START:
            self.session = Session.resumed(record.data, lambda: 0)
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
            """Takes an answer for which nobody waits."""

        session.request(message, done, record.host_us)  # type: ignore[arg-type]


def _stop(session: Session, record: Record) -> None:
    if record.data[0] == ATTACHED:
        session.stop_for_attached(_nobody, record.host_us)
    else:
        session.stop(_mode(record), _nobody, record.host_us)


def _nobody(_: Answer | WheelwireError) -> None:
    """Takes the answer to a recorded stop, for which nobody waits."""


def _asked(record: Record) -> tuple[float, float, int, int]:
    left, right, expiry_us = ASKED.unpack(record.data)
    return left, right, expiry_us, record.host_us


def _mode(record: Record) -> StopMode | None:
    return None if record.data[0] == ESTOP else StopMode(record.data[0])


def _lost(record: Record) -> LinkLost:
    return LinkLost(record.data.decode("utf-8", "replace"))


def _u32s(record: Record) -> tuple[int, ...]:
    return struct.unpack(f"<{len(record.data) // 4}I", record.data)
