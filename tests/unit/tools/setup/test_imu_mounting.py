"""How an IMU is mounted, by gravity in its axes."""

from __future__ import annotations

import math
import random
from itertools import product

import pytest

from support.cases import each
from wheelwire.board import axis_name
from wheelwire.link.sensor_stream import _turn
from wheelwire.samples import Vector
from wheelwire.tools.setup.imu_mounting import (
    GRAVITY_MPS2,
    Mean,
    Reading,
    Unclear,
    angle_deg,
    check_rest,
    forward_axis,
    in_chip,
    is_left_turn,
    is_steady,
    leftward_axis,
    mean_of,
    raised_axis,
    turned_by,
    unit,
    upward_axis,
)
from wheelwire_protocol.peripherals import Axis

MOUNTINGS = [(f, u) for f, u in product(Axis, Axis) if f % 3 != u % 3]
NOISE = 0.001, 0.02
STILL = (0.0, 0.0, 0.0)


def push(roll_deg: float = 0.0, pitch_deg: float = 0.0) -> Vector:
    """What an accelerometer of the robot's axes measures: front up and left up positive."""
    roll, pitch = math.radians(roll_deg), math.radians(pitch_deg)
    return (
        GRAVITY_MPS2 * math.sin(pitch),
        GRAVITY_MPS2 * math.cos(pitch) * math.sin(roll),
        GRAVITY_MPS2 * math.cos(pitch) * math.cos(roll),
    )


@each(("forward", "up"), MOUNTINGS)
def test_the_chips_axes_are_those_that_a_sample_was_turned_from(forward: Axis, up: Axis) -> None:
    vector = (1.0, 2.0, 3.0)
    assert in_chip(_turn(forward, up)(vector), forward, up) == vector
    assert _turn(forward, up)(unit(leftward_axis(forward, up))) == (0, 1, 0)


def test_an_axis_has_its_name_in_a_boards_file() -> None:
    assert [axis_name(axis) for axis in Axis] == ["x", "y", "z", "-x", "-y", "-z"]


def test_a_robot_that_stands_tilted_is_refused() -> None:
    assert upward_axis(push(19)) is Axis.Z
    with pytest.raises(Unclear, match="tilted by 21 degrees"):
        upward_axis(push(21))


@pytest.mark.parametrize("degrees", [14, 61])
def test_too_little_and_too_far_are_refused(degrees: float) -> None:
    sentence = f"the lift was {degrees} degrees: lift the robot by about 30, 15 to 60"
    with pytest.raises(Unclear, match=sentence):
        raised_axis(push(), push(degrees))


def test_how_far_it_was_lifted() -> None:
    assert angle_deg(push(), push(pitch_deg=33)) == pytest.approx(33)
    assert angle_deg(push(-5), push(40)) == pytest.approx(45)


def over_a_corner(astray_deg: float) -> Vector:
    """The front lifted by 30 degrees, but so far towards the left side."""
    tilt, astray = math.radians(30), math.radians(astray_deg)
    x, y, z = math.sin(tilt) * math.cos(astray), math.sin(tilt) * math.sin(astray), math.cos(tilt)
    return (GRAVITY_MPS2 * x, GRAVITY_MPS2 * y, GRAVITY_MPS2 * z)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_lift_over_a_corner_is_refused(sign: int) -> None:
    assert raised_axis(push(), over_a_corner(sign * 29)) is Axis.X
    for astray_deg in (31, 45):
        with pytest.raises(Unclear, match=f"{astray_deg} degrees from the nearer one"):
            raised_axis(push(), over_a_corner(sign * astray_deg))
    assert raised_axis(push(), over_a_corner(sign * 61)) is (Axis.Y if sign > 0 else Axis.MINUS_Y)


@pytest.mark.parametrize(
    ("front", "left", "sentence"),
    [
        (Axis.X, Axis.X, "raised x, that of the left side x, which is the same line"),
        (Axis.X, Axis.MINUS_X, "raised x, that of the left side -x, which is the same line"),
        (Axis.X, Axis.MINUS_Y, "left side -y in place of y: one of them was the rear or the right"),
        (Axis.MINUS_X, Axis.Y, "left side y in place of -y: one of them was the rear or the right"),
    ],
)
def test_mixed_up_sides_are_detected(front: Axis, left: Axis, sentence: str) -> None:
    with pytest.raises(Unclear, match=sentence):
        forward_axis(Axis.Z, front, left)


# --- at rest -------------------------------------------------------------------------------------


def readings(gyro_sigma: float, acceleration_sigma: float, count: int = 600) -> list[Reading]:
    drawn = random.Random(1)

    def noisy(vector: Vector, sigma: float) -> Vector:
        x, y, z = (drawn.gauss(part, sigma) for part in vector)
        return x, y, z

    return [
        Reading(5000 * k, noisy((0.02, -0.01, 0.0), gyro_sigma), noisy(push(), acceleration_sigma))
        for k in range(count)
    ]


def test_a_mean_has_the_largest_deviation_of_the_three_axes() -> None:
    some = [Reading(0, (1.0, 0.0, 0.0), (0, 0, 9.0)), Reading(1, (3.0, 0.0, 0.2), (0, 0, 10.0))]
    assert mean_of(some) == Mean((2.0, 0.0, 0.1), (0, 0, 9.5), 1.0, 0.5)


def test_the_chips_noise_is_rest_and_a_hand_is_not() -> None:
    assert is_steady(mean_of(readings(*NOISE)), *NOISE)
    assert is_steady(mean_of(readings(0.004, 0.08)), *NOISE)
    assert not is_steady(mean_of(readings(0.007, 0.02)), *NOISE)
    assert not is_steady(mean_of(readings(0.001, 0.14)), *NOISE)


@pytest.mark.parametrize(
    ("gyro", "acceleration", "sentence"),
    [
        ((0.0, 0.0, -0.6), push(), "measures 0.60 rad/s, and a bias is at most 0.5"),
        (STILL, (0.0, 0.0, 4.9), "measures 4.9 m/s.2 in place of 9.8"),
        (STILL, (0.0, 0.0, 19.6), "measures 19.6 m/s.2 in place of 9.8"),
    ],
)
def test_a_robot_that_turns_and_a_chip_of_another_range_are_refused(
    gyro: Vector, acceleration: Vector, sentence: str
) -> None:
    check_rest(Mean((0.35, 0.0, -0.35), push(10), 0.0, 0.0))
    with pytest.raises(Unclear, match=sentence):
        check_rest(Mean(gyro, acceleration, 0.0, 0.0))


# --- turned --------------------------------------------------------------------------------------


def turned(rate: Vector, seconds: float, bias: Vector = STILL) -> Vector:
    """By samples at 200 Hz, one in ten of which is lost."""
    x, y, z = (a + b for a, b in zip(rate, bias, strict=True))
    times_us = [5000 * k for k in range(round(200 * seconds) + 1) if k % 10 != 5]
    total, former = STILL, Reading(0, STILL, STILL)
    for t_us in times_us:
        reading = Reading(t_us, (x, y, z), STILL)
        total = turned_by(total, former, reading, bias)
        former = reading
    return total


def test_a_turn_is_the_sum_of_the_rates_without_the_bias() -> None:
    assert turned((0.0, 0.5, 0.0), 2.0, (0.1, 0.2, 0.3)) == pytest.approx((0, 1, 0))


def test_a_turn_to_the_left_is_positive_about_the_axis_that_points_up() -> None:
    assert is_left_turn(Axis.Z, turned((0, 0, 1.0), 1.1))
    assert is_left_turn(Axis.MINUS_Y, turned((0, -1.0, 0), 1.1))
    assert not is_left_turn(Axis.Z, turned((0, 0, 1.0), 1.0))
    assert not is_left_turn(Axis.Z, turned((0, 0, -1.0), 1.0))


def test_a_turn_to_the_right_or_about_another_axis_contradicts() -> None:
    with pytest.raises(Unclear, match=r"turn to the right, by 63 degrees.*contradict each other"):
        is_left_turn(Axis.Z, turned((0, 0, -1.0), 1.1))
    with pytest.raises(Unclear, match=r"by 63 degrees about a level axis"):
        is_left_turn(Axis.Z, turned((-1.0, 0, 0), 1.1))
