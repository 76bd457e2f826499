"""Why a robot stopped that nobody watched: from its black boxes, its ledger and how it stands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from wheelwire_protocol.black_box import Box, BoxError
from wheelwire_protocol.codes import ResetReason, SupervisorEvent

from ..link.info import DeviceInfo
from ..link.stored_boxes import Ledger, Recorded
from ..samples import WheelSample
from .boxes import stop_of_box, stop_of_damaged_box
from .diagnosis import Stop
from .standing import standing_stops

FAILURES = (
    ResetReason.BROWNOUT,
    ResetReason.PANIC,
    ResetReason.TASK_WATCHDOG,
    ResetReason.INTERRUPT_WATCHDOG,
)
"""Resets that nobody wants."""
_NAMES = {
    SupervisorEvent.SESSION: "ended by another session",
    SupervisorEvent.STOP: "ended by a stop",
    SupervisorEvent.DEADLINE: "out of setpoints",
    SupervisorEvent.ESTOP: "emergency stops",
    SupervisorEvent.FAULT: "faults",
}


class DatedStop(NamedTuple):
    """A stop, and whether its time is known on the host's clock."""

    stop: Stop
    is_dated: bool


def stops_of_device(device: DeviceInfo, sample: WheelSample, recorded: Recorded) -> list[DatedStop]:
    """The stops that a device knows of, the oldest first, and why it stands now.

    Args:
        device: Of the session.
        sample: The newest one.
        recorded: What was read of the device before it.

    Raises:
        NativeMissingError: The firmware's library, which reads boxes, is missing.
    """
    now_us = round(sample.stamp * 1e6)
    found: list[DatedStop] = []
    current = []
    for stored, image in recorded.boxes:
        is_dated = stored.head.boot_id == device.boot_id
        added_us = now_us - sample.t_us if is_dated else 0
        stop: Stop | None
        try:
            stop = stop_of_box(Box(image), added_us)
        except BoxError as error:
            stop = stop_of_damaged_box(stored.head, error, added_us)
        if stop is not None:
            found.append(DatedStop(stop, is_dated))
            if stored.is_current:
                current.append(stored.head)
    standing = standing_stops(device, sample.state, sample.faults, now_us, current)
    return [*found, *(DatedStop(stop, is_dated=False) for stop in standing)]


def ledger_counts(ledger: Ledger) -> dict[str, Any]:
    """What a ledger counts, for JSON."""
    return {
        "uptime_s": ledger.uptime_s,
        "stops": {event.name: count for event, count in ledger.stops.items()},
        "resets": {reason.name: count for reason, count in ledger.resets.items()},
    }


def ledger_facts(ledger: Ledger) -> dict[str, str]:
    """What a ledger counts, for people: stops and resets."""
    stops = {_NAMES[event]: count for event, count in ledger.stops.items()}
    resets = {reason.name: count for reason, count in ledger.resets.items()}
    return {
        "stops in its life": counts_text(stops),
        "starts in its life": counts_text(resets),
        "running in its life": f"{ledger.uptime_s / 3600:.1f} h",
    }


def counts_text(counts: Mapping[str, int]) -> str:
    """Those that are not 0."""
    return ", ".join(f"{name} {count}" for name, count in counts.items() if count) or "none"
