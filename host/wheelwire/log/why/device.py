"""Why an unwatched robot stopped, and what holds it, according to the device itself.

The sources are its report of what holds it and of its last stop, its state and flags, its black
boxes, and its ledger.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from wheelwire_protocol.black_box import Box, BoxError
from wheelwire_protocol.codes import (
    BoxCause,
    Capability,
    Fault,
    Held,
    ResetReason,
    StopCause,
    SupervisorEvent,
    SupervisorState,
)

from ...link.holds import HeldBy, Holding, LastStop
from ...link.info import DeviceInfo
from ...robot.black_boxes import Ledger, Recorded
from ...samples import WheelSample
from .black_box import stop_of_damaged_box, stops_of_box
from .causes import ESTOPPED, ESTOPS, LATCHES, RESETS, channel_of, latched_causes, sensed_causes
from .diagnosis import Stop, stop_of

_STOPS: dict[StopCause, tuple[str, ...]] = {
    StopCause.STOP: ("stop_by_session",),
    StopCause.STOP_OTHER: ("stop_by_stranger",),
    StopCause.ESTOP_CONTACT: ("contact_open",),
    StopCause.ESTOP_SESSION: ("estop_by_session",),
    StopCause.ESTOP_OTHER: ("estop_by_stranger",),
    StopCause.BUMPER: ("bumper_pressed",),
    StopCause.NEW_SESSION: ("new_session",),
    StopCause.HANG_UP: ("host_hung_up",),
    StopCause.TRIAL_ENDED: ("trial_expired",),
}
_SILENT = "program_paused", "host_killed", "host_frozen", "cable_pulled"
"""Why setpoints may have stopped coming, as far as the device knows."""
_LOST = (StopCause.DEADLINE, StopCause.NEW_SESSION, StopCause.HANG_UP)


def last_stop(stop: LastStop, host_us: int) -> list[Stop]:
    """What ended the last motion; nothing if that is not known.

    Args:
        stop: As the robot reports it.
        host_us: The host's clock, for a stop whose time is unknown.
    """
    if stop.cause is StopCause.UNKNOWN:
        return []
    at_us = host_us if stop.stamp is None else round(stop.stamp * 1e6)
    causes, channel = _causes(stop)
    return [stop_of(at_us, causes, (stop.cause.doc, *stop.evidence), channel)]


def _causes(stop: LastStop) -> tuple[tuple[str, ...], str]:
    """The causes that are left, and the wheel's side or the sensor's name."""
    program = stop.program
    if stop.cause in _LOST and program is not None and not program.is_running:
        return ("host_killed",), ""
    if stop.cause is StopCause.DEADLINE:
        return (_SILENT[0::2] if program is not None else _SILENT), ""
    if stop.cause is StopCause.RESET:
        return (RESETS[stop.reset_reason or ResetReason.UNKNOWN],), ""
    sensors = [flag for flag in Held if flag in stop.held]
    if stop.cause in _STOPS:
        return _STOPS[stop.cause], channel_of(sensors[0]) if sensors else ""
    found = next(latched_causes(stop.faults or Fault.EXTERNAL, sensed_causes(stop.held)))
    return found[1], found[2]


def held_stops(held_by: HeldBy, host_us: int) -> list[Stop]:
    """What else holds it now, apart from its state, each as its own cause."""
    return [
        Stop(host_us, f"held_{str(flag.name).lower()}", held_by.sentence(flag), (), "")
        for flag in held_by
        if flag not in LATCHES
    ]


NO_HISTORY = "earlier events were not recorded: record the robot to see more next time"
_STARTED = (ResetReason.POWER_ON, ResetReason.EXTERNAL)
"""The usual starts of a robot, which are not stops."""
_BEFORE_RESET = {
    SupervisorState.FAULT: "fault_before_reset",
    SupervisorState.ESTOPPED: "estop_before_reset",
}


class KnownByBoxes(NamedTuple):
    """What black boxes say of how a robot stands now.

    Attributes:
        reset: The reset that began this boot.
        estop: The e-stop that is latched.
        faults: The latched faults.
        before_reset: Number of the box of an earlier boot that tells of the same latch.
    """

    reset: bool = False
    estop: bool = False
    faults: Fault = Fault(0)
    before_reset: int | None = None


NOTHING_KNOWN = KnownByBoxes()


def standing_stops(
    device: DeviceInfo,
    state: SupervisorState,
    faults: Fault,
    host_us: int,
    known: KnownByBoxes = NOTHING_KNOWN,
    holding: Holding | None = None,
) -> list[Stop]:
    """Why a robot stands now, as far as its state, flags and last reset tell.

    Args:
        device: The session's device.
        state: State of the supervisor.
        faults: Latched.
        host_us: The host's clock.
        known: What its black boxes say of that: it is left out.
        holding: What it says itself of what holds it; None: nothing.
    """
    stops = []
    reset = device.reset_reason
    if reset not in _STARTED and not known.reset:
        evidence = (f"its last start: {reset.name}. {reset.doc}", NO_HISTORY)
        # A restart that was asked for has the same reason as one by the firmware itself.
        asked = ("restart_requested",) if reset is ResetReason.SOFTWARE else ()
        stops.append(stop_of(host_us, (*asked, RESETS[reset]), evidence))
    if known.before_reset is not None and state in _BEFORE_RESET:
        text = f"black box {known.before_reset}, of an earlier boot, is of the same"
        stops.append(stop_of(host_us, (_BEFORE_RESET[state],), (f"{state.name} now", text)))
    elif state is SupervisorState.FAULT:
        sensors = {} if holding is None else sensed_causes(holding.held_by.flags)
        for fault, causes, side in latched_causes(faults & ~known.faults, sensors):
            evidence = (f"{fault.name}: {fault.doc}", NO_HISTORY)
            stops.append(stop_of(host_us, causes, evidence, side))
    elif state is SupervisorState.ESTOPPED and not known.estop:
        stops.append(_estopped(device, host_us, holding))
    elif state is SupervisorState.TIMED_OUT and holding is not None:
        stops += last_stop(holding.last_stop, host_us)
    elif state is SupervisorState.TIMED_OUT:
        stops.append(stop_of(host_us, _SILENT, ("its newest setpoint expired", NO_HISTORY)))
    return stops


def _estopped(device: DeviceInfo, host_us: int, holding: Holding | None) -> Stop:
    evidence = ["ESTOPPED now"]
    if holding is None or holding.held_by.estop_source not in ESTOPS:
        has_contact = Capability.ESTOP_INPUT in device.capabilities
        causes = ESTOPPED if has_contact else ESTOPPED[1:]
        return stop_of(host_us, causes, (*evidence, NO_HISTORY))
    source = holding.held_by.estop_source
    evidence.append(f"latched by {source.name}: {source.doc}")
    if Held.CONTACT in holding.held_by:
        evidence.append(f"CONTACT: {Held.CONTACT.doc}")
    return stop_of(host_us, (ESTOPS[source],), evidence)


FAILURES = (
    ResetReason.BROWNOUT,
    ResetReason.PANIC,
    ResetReason.TASK_WATCHDOG,
    ResetReason.INTERRUPT_WATCHDOG,
)
"""Resets that are faults."""
STORED_US = 20_000_000
"""Age of a boot after which a latch gets its box within seconds, unless many came at once."""
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
    # A latch of this boot has its own box, except in the last seconds.
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
    if last.stamp is None:  # it was in an earlier boot
        return bool(found) and not found[-1].is_dated
    at_us = last.stamp * 1e6
    return any(
        one.is_dated
        # For a damaged box, only the time of storing is known.
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
