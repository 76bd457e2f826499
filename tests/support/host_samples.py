"""Made-up samples, for tests of one field."""

from __future__ import annotations

from typing import Any

from wheelwire.link.clock import ClockEstimator, Exchange, host_clock_us
from wheelwire.link.sample_stream import Measurement
from wheelwire.link.session import Session
from wheelwire.samples import WheelSample
from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.types import WheelState

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
    """A sample of a robot at rest, with `fields` changed."""
    return WheelSample(**{**_STANDING, **fields})


def measurement(**fields: Any) -> Measurement:
    """What was measured of a standing robot just now, with `fields` of the state frame changed."""
    state = WheelState(**{**dict.fromkeys(WheelState._fields, 0), "boot_id": 1, **fields})
    clock = ClockEstimator()
    clock.add(Exchange(0, 0, 0, 0))
    return Measurement(state, state.t_us, clock.conversion, host_clock_us())


def remeasured(sample: WheelSample) -> Measurement:
    """Back from a sample: where the wheels were, not the rest."""
    return measurement(
        boot_id=sample.boot_id, left_ticks=sample.left_ticks, right_ticks=sample.right_ticks
    )


def received(session: Session, data: bytes, now_us: int) -> list[WheelSample]:
    """The samples of what a session receives."""
    return [measurement.sample() for measurement in session.receive(data, now_us)]


def wrap(ticks: int) -> int:
    """As the wire carries it: signed 32 bits."""
    half = 1 << 31
    return (ticks + half) % (1 << 32) - half
