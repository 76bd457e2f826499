"""Why a robot stopped that nobody watched: from its black boxes, its ledger and how it stands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from wheelwire_protocol.black_box import Box, BoxError
from wheelwire_protocol.codes import BoxCause, Fault, ResetReason, SupervisorEvent, SupervisorState

from ..link.info import DeviceInfo
from ..link.stored_boxes import Ledger, Recorded
from ..samples import WheelSample
from .boxes import stop_of_damaged_box, stops_of_box
from .diagnosis import Stop
from .standing import KnownByBoxes, standing_stops

FAILURES = (
    ResetReason.BROWNOUT,
    ResetReason.PANIC,
    ResetReason.TASK_WATCHDOG,
    ResetReason.INTERRUPT_WATCHDOG,
)
"""Resets that are faults."""
STORED_US = 20_000_000
"""Age of a boot from which a latch has its box within seconds, unless many came at once."""
_LATCHES = (BoxCause.FAULT, BoxCause.ESTOP)
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
        device: The session's device.
        sample: The newest one.
        recorded: What was read of the device before it.

    Raises:
        NativeMissingError: The firmware's library, which reads boxes, is missing.
    """
    now_us = round(sample.stamp * 1e6)
    found: list[DatedStop] = []
    knows_reset, knows_estop, faults = False, False, Fault(0)
    for stored, image in recorded.boxes:
        is_dated = stored.head.boot_id == device.boot_id
        added_us = now_us - sample.t_us if is_dated else 0
        try:
            stops = stops_of_box(Box(image), added_us)
        except BoxError as error:
            stops = [stop_of_damaged_box(stored.head, error, added_us)]
        found += [DatedStop(stop, is_dated) for stop in stops]
        if stored.is_current:
            cause, is_ended = stored.head.cause, len(stops) > 1  # by the latch, before a reset
            knows_reset |= cause is BoxCause.RESET
            knows_estop |= cause is BoxCause.ESTOP or is_ended
            if cause is BoxCause.FAULT or is_ended:
                faults |= stored.head.faults
    before_reset = None
    # What was latched in this boot has a box of its own, but for the last seconds.
    if sample.t_us >= STORED_US and not knows_estop and not faults:
        before_reset = _of_earlier_boot(device, sample, recorded)
    known = KnownByBoxes(knows_reset, knows_estop, faults, before_reset)
    standing = standing_stops(device, sample.state, sample.faults, now_us, known)
    return [*found, *(DatedStop(stop, is_dated=False) for stop in standing)]


def _of_earlier_boot(device: DeviceInfo, sample: WheelSample, recorded: Recorded) -> int | None:
    """The number of the newest box of a latch, if it was latched like now, and in another boot."""
    latched = {
        SupervisorState.FAULT: BoxCause.FAULT,
        SupervisorState.ESTOPPED: BoxCause.ESTOP,
    }.get(sample.state)
    heads = [stored.head for stored, _ in recorded.boxes if stored.head.cause in _LATCHES]
    if not heads or heads[-1].cause is not latched or heads[-1].boot_id == device.boot_id:
        return None
    head = heads[-1]
    is_same = latched is BoxCause.ESTOP or head.faults == sample.faults
    return head.number if is_same else None


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
    """The counts that are not 0."""
    return ", ".join(f"{name} {count}" for name, count in counts.items() if count) or "none"
