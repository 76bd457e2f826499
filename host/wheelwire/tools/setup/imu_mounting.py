"""How an IMU is mounted, deduced from gravity while its robot stands and while it is lifted. Pure.

All vectors are in the axes of the chip's print. At rest an accelerometer measures the push of the
floor, upwards. If the robot's nose is lifted, the axis that points forward gains a part of it; if
its left side is lifted, the axis that points to the left.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache
from statistics import fmean, pstdev
from typing import NamedTuple

from wheelwire_protocol.peripherals import Axis

from ...board import axis_name
from ...errors import CommissioningFailed
from ...samples import Vector

GRAVITY_MPS2 = 9.80665
MOST_ASKEW_DEG = 20.0
"""Largest angle between gravity and the nearest printed axis, at rest."""
LEAST_LIFT_DEG = 15.0
MOST_LIFT_DEG = 60.0
MOST_ASTRAY_DEG = 30.0
"""Largest angle from a lift's direction to the nearest printed axis; 45 is half-way."""
TURNED_DEG = 60.0
"""A turn by hand, of about a quarter, is at least this large."""
MOST_BIAS_RADPS = 0.5
"""A larger rate is a turn or a defect: the data sheets' limit is 20 degrees a second."""
_STEADY = 5.0
"""Times the chip's noise: at rest, with a fan or a lidar that spins."""
_GRAVITY_ERROR = 0.15
"""Error of gravity: above what data sheets allow, below that of a wrong range."""


class Unclear(CommissioningFailed):
    """The measurement is useless. The message says why, and what to do before the next try."""


class Reading(NamedTuple):
    """One sample.

    Attributes:
        t_us: The device's clock. [us]
        gyro: Turning, with the bias. [rad/s]
        acceleration: At rest it is the upward push of the floor. [m/s^2]
    """

    t_us: int
    gyro: Vector
    acceleration: Vector


class Mean(NamedTuple):
    """Means of the samples of some time.

    Attributes:
        gyro: The mean. [rad/s]
        acceleration: The mean. [m/s^2]
        gyro_deviation: The standard deviation of the axis that has the largest one. [rad/s]
        acceleration_deviation: The same. [m/s^2]
    """

    gyro: Vector
    acceleration: Vector
    gyro_deviation: float
    acceleration_deviation: float


def mean_of(readings: Sequence[Reading]) -> Mean:
    """What the samples have in common."""
    gyro = list(zip(*(one.gyro for one in readings), strict=True))
    acceleration = list(zip(*(one.acceleration for one in readings), strict=True))
    return Mean(
        _vector(map(fmean, gyro)),
        _vector(map(fmean, acceleration)),
        max(map(pstdev, gyro)),
        max(map(pstdev, acceleration)),
    )


# --- at rest -------------------------------------------------------------------------------------


def is_steady(mean: Mean, gyro_noise: float, acceleration_noise: float) -> bool:
    """Whether the samples differ by no more than a standing robot's.

    Args:
        mean: Of the samples.
        gyro_noise: Standard deviation of the chip's samples, of its SensorInfo.
        acceleration_noise: The same.
    """
    return (
        mean.gyro_deviation <= _STEADY * gyro_noise
        and mean.acceleration_deviation <= _STEADY * acceleration_noise
    )


def check_rest(rest: Mean) -> None:
    """Check that steady samples fit a standing robot and a working IMU.

    Raises:
        Unclear: They are not.
    """
    turning = max(map(abs, rest.gyro))
    if turning > MOST_BIAS_RADPS:
        raise Unclear(
            f"at rest the gyroscope measures {turning:.2f} rad/s, and a bias is at most "
            f"{MOST_BIAS_RADPS:g}: does the robot turn? Otherwise the IMU is defective"
        )
    pushed = math.hypot(*rest.acceleration)
    if abs(pushed / GRAVITY_MPS2 - 1) > _GRAVITY_ERROR:
        raise Unclear(
            f"at rest the accelerometer measures {pushed:.1f} m/s^2 in place of 9.8: is `chip` in "
            "the board's file the mounted one? Otherwise the IMU is defective"
        )


def upward_axis(rest: Vector) -> Axis:
    """The axis that points up.

    Args:
        rest: The acceleration of a robot that stands.

    Raises:
        Unclear: None does.
    """
    axis = max(Axis, key=lambda axis: _dot(rest, unit(axis)))
    askew_deg = angle_deg(rest, unit(axis))
    if askew_deg > MOST_ASKEW_DEG:
        raise Unclear(
            f"by its IMU, the robot stands tilted by {askew_deg:.0f} degrees: stand it on a level "
            "floor. If it stands on one, the IMU is mounted at an angle: mount it so that its axes "
            "point forward, left and up"
        )
    return axis


# --- lifted --------------------------------------------------------------------------------------


def raised_axis(rest: Vector, lifted: Vector) -> Axis:
    """The axis that points to the lifted side.

    Args:
        rest: The acceleration while the robot stood.
        lifted: The acceleration while somebody holds one side up.

    Raises:
        Unclear: Somebody lifted the robot too little, too far, or over a corner.
    """
    lifted_deg = angle_deg(rest, lifted)
    if not LEAST_LIFT_DEG <= lifted_deg <= MOST_LIFT_DEG:
        raise Unclear(
            f"the lift was {lifted_deg:.0f} degrees: lift the robot by about 30, "
            f"{LEAST_LIFT_DEG:.0f} to {MOST_LIFT_DEG:.0f} will do"
        )
    gained = _across(lifted, rest)
    up = upward_axis(rest)
    level = [axis for axis in Axis if axis % 3 != up % 3]
    # Only the level part of an axis counts: the module may be a little askew.
    astray_deg = {axis: angle_deg(gained, _across(unit(axis), rest)) for axis in level}
    axis = min(level, key=lambda axis: astray_deg[axis])
    if astray_deg[axis] > MOST_ASTRAY_DEG:
        raise Unclear(
            f"the lift was between two axes of the IMU, {astray_deg[axis]:.0f} degrees from the "
            "nearer one: lift one side straight, so that the opposite side stays on the floor. If "
            "you did, the IMU is mounted at an angle: mount it so that its axes point forward, "
            "left and up"
        )
    return axis


def forward_axis(up: Axis, front: Axis, left: Axis) -> Axis:
    """The axis that points forward, which the lift of the left side confirms.

    Args:
        up: By `upward_axis`.
        front: By `raised_axis`, of the front that was lifted.
        left: The same of the left side.

    Raises:
        Unclear: The two contradict each other.
    """
    expected = leftward_axis(front, up)
    if left is expected:
        return front
    if left % 3 == front % 3:
        raise Unclear(
            f"the lift of the front raised {axis_name(front)}, that of the left side "
            f"{axis_name(left)}, which is the same line: lift the front first, then the left side"
        )
    raise Unclear(
        f"the lift of the front raised {axis_name(front)}, and that of the left side "
        f"{axis_name(left)} in place of {axis_name(expected)}: one of them was the rear or the "
        "right side"
    )


def leftward_axis(forward: Axis, up: Axis) -> Axis:
    """The axis that points to the left of a robot."""
    left = _cross(unit(up), unit(forward))
    return max(Axis, key=lambda axis: _dot(left, unit(axis)))


# --- turned --------------------------------------------------------------------------------------


def turned_by(turned: Vector, previous: Reading, reading: Reading, bias: Vector) -> Vector:
    """How far it has turned about each axis, from that at the previous sample on, in radians."""
    seconds = (reading.t_us - previous.t_us) / 1e6
    return _vector(
        angle + (rate - still) * seconds
        for angle, rate, still in zip(turned, reading.gyro, bias, strict=True)
    )


def is_left_turn(up: Axis, turned: Vector) -> bool:
    """Whether it is about a quarter to the left; False: not as far yet.

    Args:
        up: By `upward_axis`.
        turned: About each axis. [rad]

    Raises:
        Unclear: It is to the right, or about another axis.
    """
    left_deg = math.degrees(_dot(turned, unit(up)))
    if left_deg >= TURNED_DEG:
        return True
    if left_deg <= -TURNED_DEG:
        raise Unclear(
            f"the gyroscope measured a turn to the right, by {-left_deg:.0f} degrees: turn the "
            "robot to the left, counter-clockwise seen from above. If you did, accelerometer and "
            "gyroscope contradict each other: is `chip` in the board's file the mounted one?"
        )
    other_deg = math.degrees(math.hypot(*_across(turned, unit(up))))
    if other_deg >= TURNED_DEG:
        raise Unclear(
            f"the gyroscope measured a turn by {other_deg:.0f} degrees about a level axis: turn "
            "the robot on the floor. If you did, accelerometer and gyroscope contradict each "
            "other: is `chip` in the board's file the mounted one?"
        )
    return False


# --- axes ----------------------------------------------------------------------------------------


def unit(axis: Axis) -> Vector:
    """A vector of length 1 along an axis."""
    sign = 1.0 if axis < Axis.MINUS_X else -1.0
    return _vector(sign if axis % 3 == index else 0.0 for index in range(3))


def in_chip(vector: Vector, forward: Axis, up: Axis) -> Vector:
    """A vector of the robot's axes in the chip's axes."""
    return _vector(_dot(vector, along) for along in _chip_axes(forward, up))


@cache  # the same for thousands of samples
def _chip_axes(forward: Axis, up: Axis) -> tuple[Vector, ...]:
    """The chip's axes in the robot's axes."""
    axes = [unit(axis) for axis in (forward, leftward_axis(forward, up), up)]
    return tuple(map(_vector, zip(*axes, strict=True)))


def _across(vector: Vector, axis: Vector) -> Vector:
    """The part of a vector perpendicular to an axis."""
    share = _dot(vector, axis) / _dot(axis, axis)
    return _vector(a - share * b for a, b in zip(vector, axis, strict=True))


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Vector, b: Vector) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def angle_deg(a: Vector, b: Vector) -> float:
    """The angle between two vectors, such as the accelerations at rest and lifted, in degrees."""
    return math.degrees(math.atan2(math.hypot(*_cross(a, b)), _dot(a, b)))


def _vector(parts: Iterable[float]) -> Vector:
    x, y, z = parts
    return x, y, z
