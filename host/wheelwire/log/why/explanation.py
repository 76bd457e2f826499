"""What an error of the library says about the stop that caused it."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from wheelwire_protocol.codes import RefusalCode

from ...errors import DeviceRefused, LinkLost, ProtocolMismatch, WheelwireError
from .causes import (
    ESTOPPED,
    ESTOPS,
    HELD,
    REFUSALS,
    REQUEST_REFUSALS,
    cure_of_stores,
    latched_causes,
    look_at_of,
    sensed_causes,
    sensor_causes,
    sentence_of,
)

# A refused setpoint must not wait for what only a watch needs.
if TYPE_CHECKING:
    from collections.abc import Callable

    from ...link.holds import HeldBy
    from ...link.sensor_stream import SensorStream
    from .watch import StopWatch

_Said: TypeAlias = tuple[str, tuple[str, ...], str]
"""Sentence, evidence, and what to look at."""
_NOTHING: _Said = "", (), ""
_Sensors: TypeAlias = "Callable[[], SensorStream]"
"""Asked for a refusal alone: where there is one, there is a session."""


def explain(
    error: WheelwireError,
    watch: StopWatch | None,
    sensors: _Sensors | None = None,
    robot: str = "ROBOT",
    held_by: HeldBy | None = None,
) -> None:
    """Have the error say why the robot does not drive, answer or do what it was asked for.

    As far as the error, a watch of stops, the sensors and `held_by` tell. `robot`: its address,
    for commands.
    """
    error.why, error.evidence, error.look_at = _said(error, watch, sensors, held_by)
    if isinstance(error, DeviceRefused) and (cure := cure_of_stores(error.faults, robot)):
        error.why = f"{error.why} Run {cure}.".lstrip()
        error.look_at = cure


def _said(
    error: WheelwireError, watch: StopWatch | None, sensors: _Sensors | None, held_by: HeldBy | None
) -> _Said:
    if isinstance(error, LinkLost):
        return _one_of(error.causes, str(error)) if error.causes else _NOTHING
    if isinstance(error, ProtocolMismatch):
        return _one_of(("protocol_mismatch",), str(error))
    if not isinstance(error, DeviceRefused):
        return _NOTHING
    try:
        code = RefusalCode(error.code)
    except ValueError:  # of a later firmware
        return _NOTHING
    evidence = f"{code.name}: {code.doc}"
    if code not in HELD:
        name = REFUSALS.get(code) or REQUEST_REFUSALS.get(code)
        return _one_of((name,), evidence) if name else _NOTHING
    stop = watch.latched() if watch is not None else None
    if stop is not None:
        return stop.sentence, (*stop.evidence, evidence), stop.look_at
    if code is RefusalCode.ESTOPPED:
        name = None if held_by is None else ESTOPS.get(held_by.estop_source)
        return _one_of(ESTOPPED if name is None else (name,), evidence)
    if code is RefusalCode.CAUSE_PRESENT and not error.faults:
        return _one_of(("contact_open",), evidence)
    stopped = None if sensors is None else sensors().stopped
    causes_of_sensors = {} if stopped is None else sensor_causes(stopped)
    if held_by is not None and not causes_of_sensors:
        causes_of_sensors = sensed_causes(held_by.flags)
    found = list(latched_causes(error.faults, causes_of_sensors))
    return (
        " ".join(sentence_of(causes, side) for _, causes, side in found),
        (*(f"{fault.name}: {fault.doc}" for fault, _, _ in found), evidence),
        look_at_of(name for _, causes, _ in found for name in causes),
    )


def _one_of(causes: tuple[str, ...], evidence: str) -> _Said:
    return sentence_of(causes), (evidence,), look_at_of(causes)
