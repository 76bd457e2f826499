"""What a link reports by itself to its listeners."""

from __future__ import annotations

import enum
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

if TYPE_CHECKING:
    from .session import Session


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
