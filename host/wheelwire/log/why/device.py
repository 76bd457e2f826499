"""Why a robot stopped that nobody watched: from its black boxes, its ledger and how it stands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from wheelwire_protocol.black_box import Box, BoxError
from wheelwire_protocol.codes import (
    BoxCause,
    Fault,
    ResetReason,
    StopCause,
    SupervisorEvent,
    SupervisorState,
)

from ...holds import Holding, LastStop
from ...link.info import DeviceInfo, Ledger, Recorded
from ...samples import WheelSample
from .boxes import stop_of_damaged_box, stops_of_box
from .diagnosis import Stop
from .holding import held_stops, last_stop
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
DAMAGED = "box_damaged"
SAME_US = 1_000_000
"""A black box and a report that are so near to each other are of one stop."""
_LATCHES = (BoxCause.FAULT, BoxCause.ESTOP)
_FAULTS = (StopCause.FAULT, StopCause.CLIFF, StopCause.FAULT_INPUT, StopCause.BATTERY)
_ESTOPS = (StopCause.ESTOP_CONTACT, StopCause.ESTOP_SESSION, StopCause.ESTOP_OTHER)
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


def stops_of_device(
    device: DeviceInfo, sample: WheelSample, recorded: Recorded, holding: Holding
) -> list[DatedStop]:
    """The stops that a device knows of, the oldest first, and why it stands now.

    What ended its last motion is the last one before that.

    Args:
        device: The session's device.
        sample: The newest one.
        recorded: What was read of the device before it.
        holding: What the device says of what holds it.

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
    standing = standing_stops(device, sample.state, sample.faults, now_us, known, holding)
    last = holding.last_stop
    # What came after it says why the robot stands.
    is_over = last.was_earlier_start and bool(standing or knows_reset)
    if not is_over and _is_news(last, sample) and not _is_recorded(last, found):
        is_dated = last.stamp is not None
        found += [DatedStop(stop, is_dated) for stop in last_stop(last, now_us)]
    held = held_stops(holding.held_by, now_us)
    return [*found, *(DatedStop(stop, is_dated=False) for stop in (*standing, *held))]


def _is_recorded(last: LastStop, found: list[DatedStop]) -> bool:
    """Whether a black box tells of the same stop, and says more of it."""
    if last.cause not in (*_FAULTS, *_ESTOPS):
        return False
    if last.stamp is None:  # of an earlier boot
        return bool(found) and not found[-1].is_dated
    at_us = last.stamp * 1e6
    return any(
        one.is_dated
        # A damaged one has only the time at which it was stored.
        and abs(one.stop.host_us - at_us) < (STORED_US if one.stop.cause == DAMAGED else SAME_US)
        for one in found
    )


def _is_news(last: LastStop, sample: WheelSample) -> bool:
    """Whether what ended the last motion is not what the state says, which has its own cause."""
    if sample.state is SupervisorState.TIMED_OUT:
        return False
    if sample.state is SupervisorState.FAULT:
        return last.cause not in _FAULTS
    return sample.state is not SupervisorState.ESTOPPED or last.cause not in _ESTOPS


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
