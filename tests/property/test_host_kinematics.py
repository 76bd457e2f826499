import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from wheelwire.motion.kinematics import DifferentialDrive, Twist, WheelVelocities
from wheelwire.motion.odometry import Pose
from wheelwire.robot.verbs import wheels_of

speeds = st.floats(-100, 100)
drives = st.builds(
    DifferentialDrive,
    wheel_separation=st.floats(0.02, 5),
    wheel_radius=st.floats(0.005, 1),
    counts_per_revolution=st.floats(4, 200_000),
    max_velocity_mps=st.floats(0.01, 10),
)


@given(drive=drives, v=speeds, w=speeds)
def test_twist_and_wheel_velocities_are_inverse(
    drive: DifferentialDrive, v: float, w: float
) -> None:
    there_and_back = drive.twist(drive.wheel_velocities(Twist(v, w)))
    scale = 1e-9 * (1 + abs(v) + abs(w)) / drive.wheel_separation
    assert there_and_back == pytest.approx((v, w), abs=scale)


@given(drive=drives, left=speeds, right=speeds)
def test_saturation_keeps_the_ratio_and_the_limit(
    drive: DifferentialDrive, left: float, right: float
) -> None:
    slowed = drive.saturate(WheelVelocities(left, right))
    fastest = max(abs(slowed.left_mps), abs(slowed.right_mps))
    assert fastest <= drive.max_velocity_mps * (1 + 1e-12)
    assert slowed.left_mps * right == pytest.approx(slowed.right_mps * left, abs=1e-9)
    assert math.copysign(1, slowed.left_mps) == math.copysign(1, left)
    if max(abs(left), abs(right)) > drive.max_velocity_mps:
        assert fastest == pytest.approx(drive.max_velocity_mps)
    else:
        assert slowed == (left, right)


@given(drive=drives, v=speeds, w=speeds)
def test_both_steps_of_a_setpoint_in_one_call(drive: DifferentialDrive, v: float, w: float) -> None:
    in_two = drive.saturate(drive.wheel_velocities(Twist(v, w)))
    assert wheels_of(drive, v, w) == pytest.approx(in_two)


@given(
    distance=st.floats(-5, 5),
    turn=st.floats(-6, 6),
    heading=st.floats(-10, 10),
    cut=st.floats(0.05, 0.95),
)
def test_an_arc_cut_in_two_ends_at_the_same_pose(
    distance: float, turn: float, heading: float, cut: float
) -> None:
    # Near the switch to the midpoint rule both are exact to far below a micrometre.
    start = Pose(1.0, 2.0, heading)
    whole = start.advance(distance, turn)
    parts = start.advance(distance * cut, turn * cut)
    parts = parts.advance(distance * (1 - cut), turn * (1 - cut))
    assert parts == pytest.approx(whole, abs=1e-8)


@given(distance=st.floats(-5, 5), turn=st.floats(-6, 6), heading=st.floats(-10, 10))
def test_driving_back_returns_to_the_start(distance: float, turn: float, heading: float) -> None:
    assume(abs(turn) > 1e-6)
    start = Pose(0.0, 0.0, heading)
    assert start.advance(distance, turn).advance(-distance, -turn) == pytest.approx(start, abs=1e-8)
