"""The sentence that an error of the library carries: of the stop that is behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wheelwire_protocol.codes import RefusalCode

from ..errors import DeviceRefused, LinkLost, WheelwireError
from .causes import ESTOPPED, LATCHED, REFUSALS, latched_causes, sentence_of

# A refused setpoint must not wait for what only a watch needs.
if TYPE_CHECKING:
    from .watch import StopWatch


def why(error: WheelwireError, watch: StopWatch | None) -> str:
    """Why the robot does not drive or answer, as far as the error and a watch of stops know."""
    if isinstance(error, LinkLost):
        return sentence_of(error.causes) if error.causes else ""
    if not isinstance(error, DeviceRefused):
        return ""
    if error.code not in LATCHED:
        name = next((name for code, name in REFUSALS.items() if code == error.code), None)
        return sentence_of((name,)) if name else ""
    stop = watch.latched() if watch is not None else None
    if stop is not None:
        return stop.sentence
    if error.code == RefusalCode.ESTOPPED:
        return sentence_of(ESTOPPED)
    return " ".join(sentence_of(causes, side) for _, causes, side in latched_causes(error.faults))
