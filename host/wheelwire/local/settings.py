"""The parameters as the control loop wants them: scaled once, when one of them changes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from wheelwire_protocol.codes import StopMode


@dataclass(frozen=True, slots=True)
class Gains:
    """Of the velocity loop."""

    proportional: float
    """Duty per m/s."""
    integral: float
    """Duty per m/s, per control step."""
    feedforward: float
    """Duty per m/s."""
    acceleration: float
    """Duty per m/s of the target's change, per control step."""
    delay_steps: int
    """How many control steps the measured velocity is behind."""
    static: float
    """Duty that just overcomes friction."""
    limit: float
    """Of the output, either way."""


@dataclass(frozen=True, slots=True)
class FaultThresholds:
    """When a wheel is taken for faulty."""

    stall_duty: float
    stall_time_us: int
    reversal_duty: float
    reversal_mps: float


@dataclass(frozen=True, slots=True)
class Inversions:
    """What is wired the other way round."""

    motor: bool
    encoder: bool


@dataclass(frozen=True, slots=True)
class ControlSettings:
    """All that the loop reads from the parameters."""

    period_us: int
    metres_per_tick: float
    velocity_window_us: int
    gains: Gains
    faults: FaultThresholds
    max_velocity_mps: float
    velocity_step_mps: float
    """Slew limit, per control step."""
    duty_step: float
    """Slew limit, per control step."""
    left: Inversions
    right: Inversions
    stop_mode: StopMode
    brake_time_us: int
    ttl_max_us: int
    overrun_limit_us: int
    estop_input_enabled: bool
    stream_interval_us: int
    """0: no samples."""

    @classmethod
    def from_values(cls, values: Mapping[str, float]) -> ControlSettings:
        """Scale the values of all parameters, by name."""
        period_s = 1 / values["control_rate_hz"]
        rate_hz = values["stream_rate_hz"]
        return cls(
            period_us=round(period_s * 1e6),
            metres_per_tick=2 * math.pi * values["wheel_radius"] / values["counts_per_revolution"],
            velocity_window_us=round(values["velocity_window_us"]),
            gains=_gains(values, period_s),
            faults=FaultThresholds(
                stall_duty=values["stall_duty"],
                stall_time_us=_us(values["stall_time_s"]),
                reversal_duty=values["reversal_duty"],
                reversal_mps=values["reversal_velocity_mps"],
            ),
            max_velocity_mps=values["max_velocity_mps"],
            velocity_step_mps=values["max_acceleration_mps2"] * period_s,
            duty_step=values["max_duty_rate_per_s"] * period_s,
            left=_inversions(values, "left"),
            right=_inversions(values, "right"),
            stop_mode=StopMode(int(values["stop_mode"])),
            brake_time_us=_us(values["brake_time_s"]),
            ttl_max_us=_us(values["ttl_max_s"]),
            overrun_limit_us=round(values["overrun_limit_us"]),
            estop_input_enabled=bool(values["estop_input_enabled"]),
            stream_interval_us=round(1e6 / rate_hz) if rate_hz else 0,
        )


def _gains(values: Mapping[str, float], period_s: float) -> Gains:
    return Gains(
        proportional=values["proportional_gain"],
        integral=values["integral_gain"] * period_s,
        feedforward=values["velocity_feedforward"],
        acceleration=values["acceleration_feedforward"] / period_s,
        # The mean age of the ticks in the window.
        delay_steps=round(values["velocity_window_us"] * 0.5e-6 / period_s),
        static=values["static_feedforward"],
        limit=values["max_duty"],
    )


def _inversions(values: Mapping[str, float], side: str) -> Inversions:
    return Inversions(
        motor=bool(values[f"{side}_motor_inverted"]),
        encoder=bool(values[f"{side}_encoder_inverted"]),
    )


def _us(seconds: float) -> int:
    return round(seconds * 1e6)
