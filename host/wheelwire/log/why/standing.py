"""Why a robot stands that nobody watched, from what a session reports of it now."""

from __future__ import annotations

from typing import NamedTuple

from wheelwire_protocol.codes import Capability, Fault, Held, ResetReason, SupervisorState

from ...holds import Holding
from ...link.info import DeviceInfo
from .causes import ESTOPPED, ESTOPS, RESETS, latched_causes, sensed_causes
from .diagnosis import Stop, stop_of
from .holding import last_stop

NO_HISTORY = "what came before was not recorded: record the robot's day to see more next time"
_STARTED = (ResetReason.POWER_ON, ResetReason.EXTERNAL)
"""The usual starts of a robot, which are no stops."""
_BEFORE_RESET = {
    SupervisorState.FAULT: "fault_before_reset",
    SupervisorState.ESTOPPED: "estop_before_reset",
}


class KnownByBoxes(NamedTuple):
    """What black boxes say of how a robot stands now.

    Attributes:
        reset: The reset that began this boot.
        estop: The e-stop that is latched.
        faults: Those that are.
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
        silent = "program_paused", "host_killed", "host_frozen", "cable_pulled"
        stops.append(stop_of(host_us, silent, ("its newest setpoint ran out", NO_HISTORY)))
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
