"""All parameters of the firmware: one table for the chip, the host library and the docs."""

from __future__ import annotations

import enum
from functools import partial
from typing import NamedTuple

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
    """Not while driving or while a wheel turns: safety depends on it, or the controller and
    everything computed from ticks would jump."""
    RELEASED = "released"
    """Also not while an e-stop is latched: it decides whether that e-stop can be cleared."""


class Parameter(NamedTuple):
    """One parameter of the firmware. Bounds are inclusive."""

    id: int
    name: str
    changes: Changes
    unit: Unit
    default: float
    minimum: float
    maximum: float
    doc: str
    kind: Kind = Kind.REAL
    after_reset: bool = False
    """A new value takes effect at the next reset."""


_real = Parameter
_whole = partial(Parameter, kind=Kind.WHOLE)


def _switch(id_: int, name: str, changes: Changes, default: bool, doc: str) -> Parameter:
    return Parameter(id_, name, changes, Unit.NONE, float(default), 0, 1, doc, Kind.SWITCH)


_ALWAYS, _STOPPED, _RELEASED = Changes.ALWAYS, Changes.STOPPED, Changes.RELEASED

# Ids count up from 1 without a gap, as the firmware uses them as indices. A new parameter goes at
# the end: saved blocks are keyed by id, so an id that changed its meaning would be misread.
# A 32-bit float is exact for whole numbers up to 2^24, far above the largest one here.
# Formatted by hand: a table is easiest to read in rows.
# fmt: off
PARAMETERS: tuple[Parameter, ...] = (
    _real(1, "wheel_radius", _STOPPED, Unit.METRE, 0.033, 0.005, 1, "Radius of the driven wheels."),
    _real(2, "wheel_separation", _STOPPED, Unit.METRE, 0.20, 0.02, 5,
          "Between the wheels' contact points."),
    _whole(3, "counts_per_revolution", _STOPPED, Unit.TICK, 360, 4, 200_000,
           "Ticks per wheel turn, after x4 decoding and the gearbox."),
    _whole(4, "control_rate_hz", _STOPPED, Unit.HERTZ, 1000, 100, 5000,
           "Rate of the control loop; above 1000 tested in simulation only."),
    _whole(5, "pwm_frequency_hz", _ALWAYS, Unit.HERTZ, 20_000, 100, 40_000,
           "Of the power stage's PWM. Takes effect after a reset.", after_reset=True),
    _real(6, "max_velocity_mps", _ALWAYS, Unit.METRE_PER_SECOND, 0.4, 0.01, 10,
          "Limit of each wheel; beyond it both are scaled alike."),
    _real(7, "max_acceleration_mps2", _ALWAYS, Unit.METRE_PER_SECOND_SQUARED, 1.5, 0.05, 100,
          "Slew limit of velocity setpoints; a stop bypasses it."),
    _real(8, "max_duty", _ALWAYS, Unit.DUTY, 1.0, 0.1, 1, "Limit of either output."),
    _real(9, "max_duty_rate_per_s", _ALWAYS, Unit.DUTY_PER_SECOND, 20, 0.5, 1000,
          "Slew limit of duty setpoints; a stop bypasses it."),
    _real(10, "proportional_gain", _ALWAYS, Unit.DUTY_PER_MPS, 1.2, 0, 50, "Of the velocity loop."),
    _real(11, "integral_gain", _ALWAYS, Unit.DUTY_PER_METRE, 16.0, 0, 500, "Of the velocity loop."),
    _real(12, "velocity_feedforward", _ALWAYS, Unit.DUTY_PER_MPS, 1.365, 0, 50,
          "(1 - static_feedforward) / no-load speed, at nominal_supply_v."),
    _real(13, "acceleration_feedforward", _ALWAYS, Unit.DUTY_PER_MPS2, 0.143, 0, 10,
          "velocity_feedforward x the drive's mechanical time constant."),
    _real(14, "static_feedforward", _ALWAYS, Unit.DUTY, 0.055, 0, 0.5,
          "Duty that keeps a slow wheel turning."),
    _whole(15, "velocity_window_us", _ALWAYS, Unit.MICROSECOND, 20_000, 1000, 200_000,
           "Time over which velocity is measured."),
    _real(16, "ttl_max_s", _STOPPED, Unit.SECOND, 1.0, 0.02, 5,
          "Longest life of a setpoint, from its arrival."),
    _whole(17, "stop_mode", _STOPPED, Unit.NONE, 2, 1, 3,
           "1: coast. 2: brake for brake_time_s, then coast. 3: brake until the next drive, as "
           "on a slope."),
    _real(18, "brake_time_s", _STOPPED, Unit.SECOND, 1.0, 0, 5, "How long a stop brakes."),
    _real(19, "stall_duty", _STOPPED, Unit.DUTY, 0.45, 0.05, 1,
          "At this duty a wheel that does not count trips NOT_COUNTING."),
    _real(20, "stall_time_s", _STOPPED, Unit.SECOND, 0.5, 0.05, 10,
          "How long it may fail to count."),
    _real(21, "reversal_duty", _STOPPED, Unit.DUTY, 0.3, 0.05, 1,
          "At this duty a speed that grows against the drive trips REVERSED."),
    _real(22, "reversal_velocity_mps", _STOPPED, Unit.METRE_PER_SECOND, 0.15, 0.01, 5,
          "How much it may grow."),
    _whole(23, "overrun_limit_us", _STOPPED, Unit.MICROSECOND, 20_000, 2000, 1_000_000,
           "A control step this late trips CONTROL_OVERRUN."),
    _switch(24, "left_motor_inverted", _STOPPED, False, "Forward is IN2 high."),
    _switch(25, "right_motor_inverted", _STOPPED, False, "Forward is IN2 high."),
    _switch(26, "left_encoder_inverted", _STOPPED, False, "Forward is B before A."),
    _switch(27, "right_encoder_inverted", _STOPPED, False, "Forward is B before A."),
    _switch(28, "estop_input_enabled", _RELEASED, True,
            "A normally closed e-stop contact is fitted. Ground its pin before you set 0."),
    _whole(29, "glitch_filter_ns", _ALWAYS, Unit.NANOSECOND, 1000, 0, 12_787,
           "Shorter encoder pulses are ignored. Takes effect after a reset.", after_reset=True),
    _whole(30, "stream_rate_hz", _ALWAYS, Unit.HERTZ, 100, 0, 5000,
           "Rate of WheelState when a session opens."),
    _real(31, "path_gain", _ALWAYS, Unit.PER_SECOND, 2.0, 0, 20,
          "Speed added per metre that a wheel lags. With both gains 0 only velocity is "
          "controlled."),
    _real(32, "heading_gain", _ALWAYS, Unit.PER_SECOND, 10.0, 0, 50,
          "Speed shifted between the wheels per metre that one lags more: holds the heading."),
    _real(33, "path_catch_up", _ALWAYS, Unit.NONE, 0.03, 0, 0.5,
          "How much faster than its setpoint a wheel may catch up, as a fraction."),
    _real(34, "path_error_limit_m", _ALWAYS, Unit.METRE, 0.05, 0.001, 1,
          "Largest lag that a wheel catches up."),
    _real(35, "plausibility_margin", _STOPPED, Unit.DUTY, 0.38, 0.05, 1,
          "Duty beyond the feed-forward, at nominal_supply_v, that trips "
          "ENCODER_IMPLAUSIBLE; 1.25 times this limits a velocity setpoint's duty."),
    _real(36, "plausibility_time_s", _STOPPED, Unit.SECOND, 0.3, 0.05, 10,
          "How long the duty may exceed it."),
    _real(37, "nominal_supply_v", _STOPPED, Unit.VOLT, 7.4, 1, 60,
          "Battery voltage at which the feed-forward holds."),
    _real(38, "supply_drop_v", _STOPPED, Unit.VOLT, 1.3, 0, 10, "Voltage drop of the power stage."),
    _real(39, "unmeasured_supply_v", _STOPPED, Unit.VOLT, 6.2, 1, 60,
          "Battery voltage assumed if not measured; lower allows more duty."),
    _switch(40, "motors_swapped", _STOPPED, False,
            "Each power stage drives the other side's motor. left_motor_inverted stays with "
            "the left wheel."),
    _switch(41, "encoders_swapped", _STOPPED, False,
            "Each encoder is on the other side's pins. left_encoder_inverted stays with the "
            "left wheel."),
    _real(42, "rearm_gap_s", _STOPPED, Unit.SECOND, 0.5, 0, 5,
          "A pause of this and of ttl_max_s arms an unarmed robot; a zero setpoint arms it "
          "at once."),
    _real(43, "rolling_velocity_mps", _ALWAYS, Unit.METRE_PER_SECOND, 0.25, 0.02, 10,
          "A wheel this fast without drive, and not slowing down, is reported as ROLLING."),
    _whole(44, "estop_mode", _STOPPED, Unit.NONE, 2, 1, 2,
           "1: an e-stop coasts. 2: it brakes for brake_time_s and until the wheels are still, "
           "again whenever they turn; until the next drive if stop_mode is 3."),
)
# fmt: on

PARAMETER_BY_NAME: dict[str, Parameter] = {p.name: p for p in PARAMETERS}
PARAMETER_BY_ID: dict[int, Parameter] = {p.id: p for p in PARAMETERS}

PLATFORM_DEFAULTS: dict[Chip, dict[str, float]] = {
    # A process shares its processor with others, and most such robots have no e-stop contact.
    Chip.LINUX: {"control_rate_hz": 100, "overrun_limit_us": 100_000, "estop_input_enabled": 0}
}
"""Defaults that differ from those in `PARAMETERS`, by board."""


def decimal_of_float32(value: float) -> float:
    """The decimal number that was meant by a 32-bit float: 0.033, not 0.03299999982118607."""
    # Seven digits: a 32-bit float holds 7 or 8, and what was written seldom has more.
    return float(f"{value:.7g}")
