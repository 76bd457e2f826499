"""All parameters of the firmware: one table for the chip, the host library and the docs."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from .codes import Chip, Unit


class Kind(enum.Enum):
    """The kind of a parameter's values. On the wire each value is a 32-bit float."""

    REAL = "real"
    WHOLE = "whole"
    SWITCH = "switch"


class Changes(enum.Enum):
    """When a value may change. Setting the value that is already active is always allowed."""

    ALWAYS = "always"
    """Also while driving, from one control period to the next."""
    STOPPED = "stopped"
    """Neither while driving nor while a wheel turns: safety depends on it, or the controller, and
    whatever computes from ticks, would jump."""
    RELEASED = "released"
    """Nor while an e-stop is latched: it decides whether that e-stop can be cleared."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of the firmware. Bounds are inclusive."""

    id: int
    name: str
    changes: Changes
    unit: Unit
    kind: Kind
    default: float
    minimum: float
    maximum: float
    doc: str
    after_reset: bool = False
    """A new value takes effect at the next reset."""


def _real(
    id_: int,
    name: str,
    changes: Changes,
    unit: Unit,
    default: float,
    low: float,
    high: float,
    doc: str,
) -> Parameter:
    return Parameter(id_, name, changes, unit, Kind.REAL, default, low, high, doc)


def _whole(
    id_: int,
    name: str,
    changes: Changes,
    unit: Unit,
    default: int,
    low: int,
    high: int,
    doc: str,
    *,
    after_reset: bool = False,
) -> Parameter:
    doc += " Takes effect after a reset." if after_reset else ""
    return Parameter(id_, name, changes, unit, Kind.WHOLE, default, low, high, doc, after_reset)


def _switch(id_: int, name: str, changes: Changes, default: bool, doc: str) -> Parameter:
    return Parameter(id_, name, changes, Unit.NONE, Kind.SWITCH, float(default), 0, 1, doc)


_ALWAYS, _STOPPED, _RELEASED = Changes.ALWAYS, Changes.STOPPED, Changes.RELEASED

# Ids count up from 1 without a gap, as the firmware uses them as indices. A new parameter goes at
# the end: saved blocks are keyed by id, so an id that changed its meaning would be misread.
# A 32-bit float is exact for whole numbers up to 2^24, far above the largest one here.
# Formatted by hand: a table is easiest to read in rows.
# fmt: off
PARAMETERS: tuple[Parameter, ...] = (
    _real(1, "wheel_radius", _STOPPED, Unit.METRE, 0.033, 0.005, 1, "Radius of the driven wheels."),
    _real(2, "wheel_separation", _STOPPED, Unit.METRE, 0.20, 0.02, 5,
          "Between the contact points of the wheels. Stored on the device, with the robot."),
    _whole(3, "counts_per_revolution", _STOPPED, Unit.TICK, 360, 4, 200_000,
           "Ticks per wheel turn, after x4 decoding and the gearbox."),
    _whole(4, "control_rate_hz", _STOPPED, Unit.HERTZ, 1000, 100, 5000,
           "Rate of the control loop. Above 1000 tested in simulation only."),
    _whole(5, "pwm_frequency_hz", _ALWAYS, Unit.HERTZ, 20_000, 100, 40_000,
           "PWM frequency on the bridge's enable inputs.", after_reset=True),
    _real(6, "max_velocity_mps", _ALWAYS, Unit.METRE_PER_SECOND, 0.4, 0.01, 10,
          "Limit of each wheel; above it both setpoints are scaled by one factor."),
    _real(7, "max_acceleration_mps2", _ALWAYS, Unit.METRE_PER_SECOND_SQUARED, 1.5, 0.05, 100,
          "Slew limit of the velocity setpoints. A stop bypasses it."),
    _real(8, "max_duty", _ALWAYS, Unit.DUTY, 1.0, 0.1, 1, "Limit of either output."),
    _real(9, "max_duty_rate_per_s", _ALWAYS, Unit.DUTY_PER_SECOND, 20, 0.5, 1000,
          "Slew limit of duty setpoints. A stop bypasses it."),
    _real(10, "proportional_gain", _ALWAYS, Unit.DUTY_PER_MPS, 1.2, 0, 50,
          "Proportional gain of the velocity loop."),
    _real(11, "integral_gain", _ALWAYS, Unit.DUTY_PER_METRE, 16.0, 0, 500,
          "Integral gain of the velocity loop."),
    _real(12, "velocity_feedforward", _ALWAYS, Unit.DUTY_PER_MPS, 1.365, 0, 50,
          "Duty per speed: (1 - static_feedforward) / no-load speed, at nominal_supply_v."),
    _real(13, "acceleration_feedforward", _ALWAYS, Unit.DUTY_PER_MPS2, 0.143, 0, 10,
          "Duty per acceleration: velocity_feedforward x the drive's mechanical time constant."),
    _real(14, "static_feedforward", _ALWAYS, Unit.DUTY, 0.055, 0, 0.5,
          "Dead-band compensation: the duty that keeps a slow wheel turning."),
    _whole(15, "velocity_window_us", _ALWAYS, Unit.MICROSECOND, 20_000, 1000, 200_000,
           "Velocity is measured between ticks about this long apart."),
    _real(16, "ttl_max_s", _STOPPED, Unit.SECOND, 1.0, 0.02, 5,
          "A setpoint expires at the latest this long after its arrival."),
    _whole(17, "stop_mode", _STOPPED, Unit.NONE, 2, 1, 3,
           "1: coast. 2: brake for brake_time_s, then coast. 3: brake until driven, as on a slope; "
           "the power stage then stays switched on."),
    _real(18, "brake_time_s", _STOPPED, Unit.SECOND, 1.0, 0, 5, "How long a stop brakes."),
    _real(19, "stall_duty", _STOPPED, Unit.DUTY, 0.45, 0.05, 1,
          "At this duty or more a wheel must count, or NOT_COUNTING trips."),
    _real(20, "stall_time_s", _STOPPED, Unit.SECOND, 0.5, 0.05, 10,
          "For how long the wheel may fail to count."),
    _real(21, "reversal_duty", _STOPPED, Unit.DUTY, 0.3, 0.05, 1,
          "At this duty or more speed must not grow against the drive, or REVERSED trips."),
    _real(22, "reversal_velocity_mps", _STOPPED, Unit.METRE_PER_SECOND, 0.15, 0.01, 5,
          "By how much the speed may grow."),
    _whole(23, "overrun_limit_us", _STOPPED, Unit.MICROSECOND, 20_000, 2000, 1_000_000,
           "A control step this late trips CONTROL_OVERRUN."),
    _switch(24, "left_motor_inverted", _STOPPED, False, "Forward is IN2 high."),
    _switch(25, "right_motor_inverted", _STOPPED, False, "Forward is IN2 high."),
    _switch(26, "left_encoder_inverted", _STOPPED, False, "Forward is B before A."),
    _switch(27, "right_encoder_inverted", _STOPPED, False, "Forward is B before A."),
    _switch(28, "estop_input_enabled", _RELEASED, True,
            "The normally-closed e-stop contact is fitted; an open contact or wire is an e-stop. "
            "If none is fitted, connect its pin to ground while you set this to 0."),
    _whole(29, "glitch_filter_ns", _ALWAYS, Unit.NANOSECOND, 1000, 0, 12_787,
           "Shorter encoder pulses are ignored.", after_reset=True),
    _whole(30, "stream_rate_hz", _ALWAYS, Unit.HERTZ, 100, 0, 5000,
           "Rate of WheelState when a session opens."),
    _real(31, "path_gain", _ALWAYS, Unit.PER_SECOND, 2.0, 0, 20,
          "Speed added for each metre that a wheel is behind the integral of its setpoint. "
          "With this and heading_gain 0 the loop controls velocity alone."),
    _real(32, "heading_gain", _ALWAYS, Unit.PER_SECOND, 10.0, 0, 50,
          "Speed taken from one wheel and added to the other for each metre that the other is "
          "further behind, to hold the heading."),
    _real(33, "path_catch_up", _ALWAYS, Unit.NONE, 0.03, 0, 0.5,
          "Fraction of its setpoint by which a wheel may turn faster to catch up."),
    _real(34, "path_error_limit_m", _ALWAYS, Unit.METRE, 0.05, 0.001, 1,
          "A wheel never has more than this to catch up; the rest is dropped."),
    _real(35, "plausibility_margin", _STOPPED, Unit.DUTY, 0.38, 0.05, 1,
          "Duty beyond the feed-forward that a load may need, at nominal_supply_v. More than that "
          "at the measured speed trips ENCODER_IMPLAUSIBLE; 1.25 times that limits the duty of "
          "a velocity setpoint."),
    _real(36, "plausibility_time_s", _STOPPED, Unit.SECOND, 0.3, 0.05, 10,
          "For how long the duty may exceed plausibility_margin."),
    _real(37, "nominal_supply_v", _STOPPED, Unit.VOLT, 7.4, 1, 60,
          "Battery voltage at which the feed-forward holds."),
    _real(38, "supply_drop_v", _STOPPED, Unit.VOLT, 1.3, 0, 10,
          "Voltage drop of the bridge."),
    _real(39, "unmeasured_supply_v", _STOPPED, Unit.VOLT, 6.2, 1, 60,
          "Battery voltage assumed if it is not measured; a lower value allows more duty."),
    _switch(40, "motors_swapped", _STOPPED, False,
            "The left bridge drives the right wheel's motor, and the right bridge the left one's. "
            "left_motor_inverted is always of the left wheel's motor."),
    _switch(41, "encoders_swapped", _STOPPED, False,
            "The left encoder's pins have the right wheel's encoder, and the right ones the left "
            "wheel's. left_encoder_inverted is always of the left wheel's encoder."),
    _real(42, "rearm_gap_s", _STOPPED, Unit.SECOND, 0.5, 0, 5,
          "After a start, after an e-stop or a fault was cleared, and after a bumper held it off, "
          "the robot drives once a zero setpoint came, or none for this long and for ttl_max_s."),
    _real(43, "rolling_velocity_mps", _ALWAYS, Unit.METRE_PER_SECOND, 0.25, 0.02, 10,
          "A wheel that turns this fast without drive, and does not slow down, is reported as "
          "ROLLING."),
    _whole(44, "estop_mode", _STOPPED, Unit.NONE, 2, 1, 2,
           "What an e-stop does, by message or by its contact. 1: coast, for a robot that falls "
           "over when it brakes. 2: brake for brake_time_s and until the wheels are still, again "
           "whenever they turn; until driven if stop_mode is 3."),
)
# fmt: on

PARAMETER_BY_NAME: dict[str, Parameter] = {p.name: p for p in PARAMETERS}
PARAMETER_BY_ID: dict[int, Parameter] = {p.id: p for p in PARAMETERS}

PLATFORM_DEFAULTS: dict[Chip, dict[str, float]] = {
    # A process shares its processor with others, and most such robots have no e-stop contact.
    Chip.LINUX: {
        "control_rate_hz": 100,
        "overrun_limit_us": 100_000,
        "estop_input_enabled": 0,
    },
}
"""Defaults that differ from those in `PARAMETERS`, by board."""
