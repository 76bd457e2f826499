import math

import pytest

from wheelwire.errors import ParameterOutOfRange
from wheelwire.motion.kinematics import DifferentialDrive, Twist, WheelVelocities

ROBOT = DifferentialDrive(
    wheel_separation=0.2, wheel_radius=0.033, counts_per_revolution=360, max_velocity_mps=0.4
)


def test_a_left_turn_makes_the_right_wheel_faster() -> None:
    assert ROBOT.wheel_velocities(Twist(0.2, 1.0)) == pytest.approx((0.1, 0.3))


def test_saturation_keeps_the_radius_of_the_path() -> None:
    slowed = ROBOT.twist(ROBOT.saturate(ROBOT.wheel_velocities(Twist(0.4, 1.5))))
    assert slowed == pytest.approx((0.291, 1.091), abs=5e-4)
    assert slowed.linear_mps / slowed.angular_radps == pytest.approx(0.4 / 1.5)


def test_saturation_leaves_a_slow_robot_alone() -> None:
    wheels = WheelVelocities(-0.4, 0.1)
    assert ROBOT.saturate(wheels) is wheels


@pytest.mark.parametrize(("counts", "millimetres"), [(360, 0.576), (1440, 0.144)])
def test_metres_per_tick(counts: int, millimetres: float) -> None:
    drive = DifferentialDrive(0.2, 0.033, counts)
    assert drive.metres_per_tick * 1000 == pytest.approx(millimetres, abs=5e-4)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_an_impossible_robot_is_refused_by_name(value: float) -> None:
    with pytest.raises(ParameterOutOfRange, match="wheel_radius"):
        DifferentialDrive(0.2, value, 360)


@pytest.mark.parametrize(
    ("larger", "expected"),
    [("left_radius_multiplier", (0.2, 0.21)), ("right_radius_multiplier", (0.21, 0.2))],
)
def test_a_larger_wheel_turns_less(larger: str, expected: tuple[float, float]) -> None:
    drive = DifferentialDrive(0.2, 0.033, 360, **{larger: 1.05})
    wheels = drive.wheel_velocities(Twist(0.21, 0.0))
    assert wheels == pytest.approx(expected)
    assert drive.twist(wheels) == pytest.approx((0.21, 0.0))


def test_backwards_the_limit_holds_too() -> None:
    assert ROBOT.saturate(WheelVelocities(-0.8, -0.4)) == pytest.approx((-0.4, -0.2))
