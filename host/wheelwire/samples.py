"""What is asked of both wheels, samples of them, and the travel between two samples."""

from __future__ import annotations

from typing import NamedTuple

from wheelwire_protocol.codes import Fault, SupervisorState

TICK_MODULUS = 1 << 32


def tick_difference(later: int, earlier: int) -> int:
    """Signed difference of two 32-bit counters, exact while it is below 2^31."""
    # Shifted by half the range and back, the remainder lies in -2^31 to 2^31 - 1.
    half = TICK_MODULUS // 2
    return (later - earlier + half) % TICK_MODULUS - half


class Setpoint(NamedTuple):
    """What a program asked of the wheels."""

    left: float
    """m/s, or with `duty` a duty, -1..1."""
    right: float
    duty: bool


class WheelTravel(NamedTuple):
    """The travel of both wheels from one sample to a later one."""

    left: int
    """Ticks, forward positive."""
    right: int
    """Ticks, forward positive."""
    dt_s: float
    """Time between the samples on the device's clock."""
    rebased: bool
    """Whether the device was reset in between: the travel is unknown then, and given as 0."""


class WheelSample(NamedTuple):
    """Both encoders, latched by the device at one instant.

    Attributes:
        boot_id: Random number drawn by the device at each reset.
        t_us: The device's clock at the latch, 64 bits. [us]
        left_ticks: Cumulative, as on the wire: wraps at 2^32.
        right_ticks: Cumulative, as on the wire: wraps at 2^32.
        left_mps: Measured at the rim. [m/s]
        right_mps: Measured at the rim. [m/s]
        left_duty: On the output, -1..1; 0 when not driving.
        right_duty: On the output, -1..1; 0 when not driving.
        command_seq: Number of the setpoint obeyed now, or the last one obeyed.
        state: State of the supervisor.
        faults: Latched faults.
        overruns: Control steps that were late, since the reset. Wraps at 2^16.
        battery_v: None if the device does not measure it. [V]
        stamp: Time of the latch on this host's `time.monotonic()`. [s]
        stamp_error_s: Error bound of the stamp. [s]
    """

    boot_id: int
    t_us: int
    left_ticks: int
    right_ticks: int
    left_mps: float
    right_mps: float
    left_duty: float
    right_duty: float
    command_seq: int
    state: SupervisorState
    faults: Fault
    overruns: int
    battery_v: float | None
    stamp: float
    stamp_error_s: float

    def since(self, earlier: WheelSample) -> WheelTravel:
        """The travel from `earlier` to this sample, correct across counter wraps."""
        # A reset sets the counters back: across it their difference means nothing.
        if self.boot_id != earlier.boot_id:
            return WheelTravel(0, 0, 0.0, rebased=True)
        return WheelTravel(
            tick_difference(self.left_ticks, earlier.left_ticks),
            tick_difference(self.right_ticks, earlier.right_ticks),
            (self.t_us - earlier.t_us) / 1e6,
            rebased=False,
        )
