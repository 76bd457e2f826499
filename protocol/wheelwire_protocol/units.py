"""The units of fields and parameters."""

from __future__ import annotations

import enum


class Unit(enum.Enum):
    """The unit of a field, as written in MESSAGES.md."""

    NONE = ""
    TICK = "tick"
    MICROSECOND = "us"
    NANOSECOND = "ns"
    SECOND = "s"
    METRE = "m"
    MILLIMETRE = "mm"
    METRE_PER_SECOND = "m/s"
    MILLIMETRE_PER_SECOND = "mm/s"
    METRE_PER_SECOND_SQUARED = "m/s^2"
    HERTZ = "Hz"
    PER_SECOND = "1/s"
    VOLT = "V"
    MILLIVOLT = "mV"
    MILLIAMPERE = "mA"
    MILLIAMPERE_HOUR = "mAh"
    CENTIDEGREE_CELSIUS = "0.01 degC"
    RADIAN_PER_SECOND = "rad/s"
    COUNT = "count"
    DUTY = "duty (-1..1)"
    DUTY_Q15 = "duty x 32767"
    DUTY_PER_SECOND = "duty/s"
    DUTY_PER_MPS = "duty/(m/s)"
    DUTY_PER_MPS2 = "duty/(m/s^2)"
    DUTY_PER_METRE = "duty/m"
