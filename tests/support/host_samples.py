"""Samples out of nothing, for tests that look at one field."""

from __future__ import annotations

from typing import Any

from wheelwire.samples import WheelSample
from wheelwire_protocol.codes import Fault, SupervisorState

_STANDING: dict[str, Any] = {
    "boot_id": 1,
    "t_us": 0,
    "left_ticks": 0,
    "right_ticks": 0,
    "left_mps": 0.0,
    "right_mps": 0.0,
    "left_duty": 0.0,
    "right_duty": 0.0,
    "command_seq": 0,
    "state": SupervisorState.IDLE,
    "faults": Fault(0),
    "overruns": 0,
    "battery_v": None,
    "stamp": 0.0,
    "stamp_error_s": 0.0,
}


def sample(**fields: Any) -> WheelSample:
    """A standing robot's sample, with `fields` changed."""
    return WheelSample(**{**_STANDING, **fields})


def wrap(ticks: int) -> int:
    """As the wire carries it: signed 32 bits."""
    half = 1 << 31
    return (ticks + half) % (1 << 32) - half
