"""Bumpers and cliffs as points about the robot, for viewers and planners."""

from __future__ import annotations

import math
from collections.abc import Sequence

from wheelwire_protocol.sensors import PeripheralKind, Place

from ..samples import InputsSample, SensorInfo

OBSTACLES = (PeripheralKind.BUMPER, PeripheralKind.CLIFF)
ANGLES_DEG = {
    Place.NONE: 0.0,
    Place.FRONT: 0.0,
    Place.FRONT_LEFT: 45.0,
    Place.FRONT_RIGHT: -45.0,
    Place.LEFT: 90.0,
    Place.RIGHT: -90.0,
    Place.REAR: 180.0,
    Place.REAR_LEFT: 135.0,
    Place.REAR_RIGHT: -135.0,
}
"""Where an input is, counter-clockwise from the front."""


def obstacles(
    infos: Sequence[SensorInfo], sample: InputsSample, radius_m: float, height_m: float
) -> list[tuple[float, float, float]]:
    """A point where each triggered bumper or cliff is, on a circle about the robot's centre."""
    points = []
    for info in infos:
        reading = sample.channels.get(info.name)
        if info.kind in OBSTACLES and reading is not None and reading.triggered:
            angle_rad = math.radians(ANGLES_DEG[info.place])
            x_m, y_m = radius_m * math.cos(angle_rad), radius_m * math.sin(angle_rad)
            points.append((x_m, y_m, height_m))
    return points
