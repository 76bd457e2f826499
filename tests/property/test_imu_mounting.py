"""An IMU's mounting whatever it is, however far its robot is lifted, and whatever its noise is."""

from __future__ import annotations

import math
from itertools import product
from typing import NamedTuple

from hypothesis import given
from hypothesis import strategies as st

from wheelwire.samples import Vector
from wheelwire.tools.setup.imu_mounting import (
    GRAVITY_MPS2,
    forward_axis,
    in_chip,
    raised_axis,
    upward_axis,
)
from wheelwire_protocol.peripherals import Axis

MOUNTINGS = [(f, u) for f, u in product(Axis, Axis) if f % 3 != u % 3]
ASKEW_DEG = st.floats(-6, 6)
NOISE_MPS2 = 0.05
"""Noise of the mean of half a second, on each axis: ten times that of the noisiest chip."""
UNSURE_DEG = math.degrees(2 * math.sqrt(3) * NOISE_MPS2 / GRAVITY_MPS2)
"""How far such noise of both measurements can turn a lift."""
LIFTS_DEG = st.floats(15 + UNSURE_DEG, 60 - UNSURE_DEG)


class Robot(NamedTuple):
    """An IMU on its robot."""

    forward: Axis
    up: Axis
    roll_deg: float
    """Tilt of the print on the robot and of the floor."""
    pitch_deg: float

    def measured(self, noise: Vector, angle_deg: float = 0.0, toward_deg: float = 0.0) -> Vector:
        """The acceleration in the chip's axes.

        Args:
            noise: Added to it.
            angle_deg: How far the robot is lifted.
            toward_deg: The side that is up: 0 the front, 90 the left one.
        """
        vector = lifted((0.0, 0.0, GRAVITY_MPS2), angle_deg, toward_deg)
        vector = lifted(lifted(vector, self.pitch_deg, 0.0), self.roll_deg, 90.0)
        chip = in_chip(vector, self.forward, self.up)
        x, y, z = (a + b for a, b in zip(chip, noise, strict=True))
        return x, y, z


def lifted(vector: Vector, angle_deg: float, toward_deg: float) -> Vector:
    """As it is seen by a robot that is lifted: Rodrigues' formula, about a level axis."""
    angle, toward = math.radians(angle_deg), math.radians(toward_deg)
    # Along the axis, which is to the right of the side that is lifted, and across it.
    k = (-math.sin(toward), math.cos(toward), 0.0)
    cross = (k[1] * vector[2], -k[0] * vector[2], k[0] * vector[1] - k[1] * vector[0])
    dot = k[0] * vector[0] + k[1] * vector[1]
    x, y, z = (
        v * math.cos(angle) + c * math.sin(angle) + a * dot * (1 - math.cos(angle))
        for v, c, a in zip(vector, cross, k, strict=True)
    )
    return x, y, z


noises = st.tuples(*[st.floats(-NOISE_MPS2, NOISE_MPS2)] * 3)
robots = st.builds(
    lambda axes, roll_deg, pitch_deg: Robot(axes[0], axes[1], roll_deg, pitch_deg),
    st.sampled_from(MOUNTINGS),
    ASKEW_DEG,
    ASKEW_DEG,
)


@given(robots, LIFTS_DEG, LIFTS_DEG, st.floats(-20, 20), st.floats(-20, 20), noises, noises)
def test_it_is_found_by_two_lifts_that_are_about_straight(
    robot: Robot,
    front_deg: float,
    left_deg: float,
    front_astray_deg: float,
    left_astray_deg: float,
    at_rest: Vector,
    while_lifted: Vector,
) -> None:
    rest = robot.measured(at_rest)
    front = robot.measured(while_lifted, front_deg, front_astray_deg)
    left = robot.measured(while_lifted, left_deg, 90 + left_astray_deg)
    up = upward_axis(rest)
    assert up is robot.up
    assert forward_axis(up, raised_axis(rest, front), raised_axis(rest, left)) is robot.forward
