"""What holds a robot and what ended its last motion, as causes: by what the device says."""

from __future__ import annotations

from wheelwire_protocol.codes import Fault, Held, ResetReason, StopCause

from ...holds import HeldBy, LastStop
from .causes import LATCHES, RESETS, channel_of, latched_causes, sensed_causes
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
        host_us: The host's clock, for one whose time is not known.
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
    """What holds it now beside what its state says, each as a cause of its own."""
    return [
        Stop(host_us, f"held_{str(flag.name).lower()}", held_by.sentence(flag), (), "")
        for flag in held_by
        if flag not in LATCHES
    ]
