"""Telemetry of a robot that drives a curve, for benchmarks."""

from __future__ import annotations

from collections.abc import Iterator

from wheelwire_protocol import Encoder
from wheelwire_protocol.types import WheelState


def wheel_states(count: int) -> Iterator[WheelState]:
    """States 1 ms apart; no two are equal."""
    for i in range(count):
        yield WheelState(
            boot_id=0x5EED1234,
            t_us=1000 * i,
            left_ticks=7 * i // 10,
            right_ticks=-9 * i // 10,
            left_mps=0.25 + i % 16 / 512,
            right_mps=-0.3,
            left_duty_q15=12_000 + i % 100,
            right_duty_q15=-14_000,
            command_seq=i // 20,
            supervisor=2,
            faults=0,
            overruns=0,
            battery_mv=11_800 - i % 7,
        )


def capture(count: int) -> bytes:
    """The frames of `wheel_states`."""
    return b"".join(map(Encoder().encode, wheel_states(count)))
