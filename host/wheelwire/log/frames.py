"""Finds the messages that crossed the link, one by one, by core's decoder."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from wheelwire_protocol.decoder import Decoder

from ..link.traffic import Kind, Record


class Frame(NamedTuple):
    """One message, and when its last byte crossed the link."""

    host_us: int
    """The host's monotonic clock, as in a sample's stamp."""
    is_sent: bool
    """Whether the host sent it."""
    message: Any


class FrameReader:
    """Finds the messages of both directions in a tap's records."""

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
