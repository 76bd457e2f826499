"""What a device has recorded of its stops: its black boxes and its ledger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wheelwire_protocol.black_box import BoxHead
from wheelwire_protocol.codes import ResetReason, SupervisorEvent


class StoredBox(NamedTuple):
    """A black box that a device has stored.

    Attributes:
        head: Why, when and on which board it was stored.
        size: In bytes.
        is_current: Whether it ends with the device's present state, or with the reset that began
            this boot.
    """

    head: BoxHead
    size: int
    is_current: bool


@dataclass(frozen=True)
class Ledger:
    """What happened to a robot in its life.

    Attributes:
        uptime_s: In all [s]. A power cut costs all counts of the last ten minutes at most, any
            other reset a second of this.
        resets: Starts by their reason.
        stops: E-stops and faults, and drives that a session, a stop or a deadline ended.
    """

    uptime_s: int
    resets: Mapping[ResetReason, int]
    stops: Mapping[SupervisorEvent, int]


class Recorded(NamedTuple):
    """All that a device has recorded.

    Attributes:
        boxes: With what each of them holds, the oldest first.
        ledger: None: it has none, or does not say.
        why_none: Why nothing could be read; empty if something was.
    """

    boxes: Sequence[tuple[StoredBox, bytes]] = ()
    ledger: Ledger | None = None
    why_none: str = ""
