"""Why a robot stands that nobody watched, from what a session reports of it now."""

from __future__ import annotations

from collections.abc import Sequence

from wheelwire_protocol.black_box import BoxHead
from wheelwire_protocol.codes import BoxCause, Capability, Fault, ResetReason, SupervisorState

from ..link.info import DeviceInfo
from .causes import ESTOPPED, RESETS, latched_causes
from .diagnosis import Stop, stop_of

NO_HISTORY = "what came before was not recorded: record the robot's day to see more next time"
_STARTED = (ResetReason.POWER_ON, ResetReason.EXTERNAL, ResetReason.UNKNOWN)
"""As robots start: of itself no stop."""


def standing_stops(
    device: DeviceInfo,
    state: SupervisorState,
    faults: Fault,
    host_us: int,
    current: Sequence[BoxHead] = (),
) -> list[Stop]:
    """Why a robot stands now, as far as its state, flags and last reset tell.

    Args:
        device: Of the session.
        state: Of the supervisor.
        faults: Latched.
        host_us: The host's clock.
        current: Black boxes of how it stands now: what they are of is left out.
    """
    stops = []
    told = {head.cause for head in current}
    reset = device.reset_reason
    if reset not in _STARTED and BoxCause.RESET not in told:
        evidence = (f"its last start: {reset.name}. {reset.doc}", NO_HISTORY)
        # A restart that was asked for has the same reason as one by the firmware itself.
        asked = ("restart_requested",) if reset is ResetReason.SOFTWARE else ()
        stops.append(stop_of(host_us, (*asked, RESETS[reset]), evidence))
    if state is SupervisorState.FAULT:
        for head in current:
            if head.cause is BoxCause.FAULT:
                faults &= ~head.faults
        for fault, causes, side in latched_causes(faults):
            evidence = (f"{fault.name}: {fault.doc}", NO_HISTORY)
            stops.append(stop_of(host_us, causes, evidence, side))
    elif state is SupervisorState.ESTOPPED and BoxCause.ESTOP not in told:
        has_contact = Capability.ESTOP_INPUT in device.capabilities
        causes = ESTOPPED if has_contact else ESTOPPED[1:]
        stops.append(stop_of(host_us, causes, ("ESTOPPED now", NO_HISTORY)))
    elif state is SupervisorState.TIMED_OUT:
        silent = "program_paused", "host_killed", "host_frozen", "cable_pulled"
        stops.append(stop_of(host_us, silent, ("its newest setpoint ran out", NO_HISTORY)))
    return stops
