"""What a link reports by itself to its listeners."""

from __future__ import annotations

import enum
from collections.abc import Callable
from typing import NamedTuple, TypeAlias


class Happening(enum.Enum):
    """What has happened. The value is the name of a driver's callback."""

    LOST = "on_lost"
    """The robot is out of reach; reported with the error that every call raises."""
    OPENED = "on_opened"
    """A session was opened; reported with the device."""
    FAULT = "on_fault"
    """A fault was latched; reported with all that are."""
    STOPPED = "watch_stops"
    """The robot has stopped; reported with the stop, by a watch, and never by the link itself."""


class StandingNews(NamedTuple):
    """News of what was so already when a listener asked for it, which may be a repeat."""

    happening: Happening
    subject: object


News: TypeAlias = "tuple[Happening, object]"
Listener: TypeAlias = Callable[[News], object]
"""Takes what has happened, in order. Never waits."""
