"""A link whose session happens in another program, or happened: it is run again from records."""

from __future__ import annotations

from wheelwire_protocol.types import Hold

from ..errors import LinkLost, WheelwireError
from ..link.device_link import DeviceLink
from ..link.sample_stream import LatestSample
from ..link.session import Phase, Session
from ..link.threads import Notifier
from ..link.traffic import Record
from .rerun import Rerun


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
            raise LinkLost(f"{self.name}: nothing is known of its session yet; wait a moment")
        return session

    @property
    def _is_open(self) -> bool:
        session = self._rerun.session
        return session is not None and session.phase is Phase.OPEN

    @property
    def hold(self) -> Hold | None:
        """As `Session.hold`; None, too, while nothing is known of a session."""
        session = self._rerun.session
        return None if session is None else session.hold

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
