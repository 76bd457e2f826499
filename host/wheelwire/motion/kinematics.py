"""The differential drive: body velocity to wheel velocities and back.

REP-103: x forward, counter-clockwise positive. v = (r + l) / 2, w = (r - l) / wheel_separation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple

from wheelwire_protocol.parameters import PARAMETER_BY_NAME, decimal_of_float32

from ..arguments import is_number
from ..errors import ParameterOutOfRange

GEOMETRY = tuple(
    PARAMETER_BY_NAME[name].id
    for name in ("wheel_separation", "wheel_radius", "counts_per_revolution", "max_velocity_mps")
)
"""The parameters of a device that say how its robot is built."""


class Twist(NamedTuple):
    """Velocity of the body, at the middle between the wheels."""

    linear_mps: float
    """Forward positive."""
    angular_radps: float
    """Counter-clockwise positive."""


class WheelVelocities(NamedTuple):
    """Velocities of the wheels' rims, forward positive."""

    left_mps: float
    right_mps: float


@dataclass(frozen=True)
class DifferentialDrive:
    """The geometry of one robot.

    Attributes:
        wheel_separation: Between the wheels' contact points. [m]
        wheel_radius: [m]
        counts_per_revolution: Ticks per wheel turn, after x4 decoding and the gearbox.
        max_velocity_mps: Limit of each wheel. [m/s]
        left_radius_multiplier: Real radius divided by `wheel_radius`, from calibration.
        right_radius_multiplier: The same for the right wheel.

    Raises:
        ParameterOutOfRange: One of them is not a positive finite number.
    """

    wheel_separation: float
    wheel_radius: float
    counts_per_revolution: float
    max_velocity_mps: float = math.inf
    left_radius_multiplier: float = 1.0
    right_radius_multiplier: float = 1.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            unlimited = field.name == "max_velocity_mps" and value == math.inf
            if not unlimited and not (is_number(value) and value > 0):
                raise ParameterOutOfRange(field.name, value, "a positive finite number")

    @classmethod
    def of_device(cls, values: Mapping[int, float]) -> DifferentialDrive:
        """As the device has it, by the values of `GEOMETRY`."""
        return cls(*[decimal_of_float32(values[parameter]) for parameter in GEOMETRY])

    @property
    def metres_per_tick(self) -> float:
        """Travel per tick of a wheel with `wheel_radius`, in metres."""
        return 2 * math.pi * self.wheel_radius / self.counts_per_revolution

    def wheel_velocities(self, twist: Twist) -> WheelVelocities:
        """The wheel velocities for `twist`, as of wheels with `wheel_radius`; not limited."""
        difference = twist.angular_radps * self.wheel_separation / 2
        return WheelVelocities(
            (twist.linear_mps - difference) / self.left_radius_multiplier,
            (twist.linear_mps + difference) / self.right_radius_multiplier,
        )

    def twist(self, wheels: WheelVelocities) -> Twist:
        """The body's velocity for velocities of wheels with `wheel_radius`."""
        left = wheels.left_mps * self.left_radius_multiplier
        right = wheels.right_mps * self.right_radius_multiplier
        return Twist((right + left) / 2, (right - left) / self.wheel_separation)

    def saturate(self, wheels: WheelVelocities) -> WheelVelocities:
        """Scale both wheels by one factor, so that the faster one is within the limit.

        The path's radius is (L/2)(r + l)/(r - l): one factor keeps it, clamping each bends it.
        """
        limit = self.max_velocity_mps
        if -limit <= wheels.left_mps <= limit and -limit <= wheels.right_mps <= limit:
            return wheels
        fastest = max(abs(wheels.left_mps), abs(wheels.right_mps))
        factor = self.max_velocity_mps / fastest
        return WheelVelocities(wheels.left_mps * factor, wheels.right_mps * factor)
