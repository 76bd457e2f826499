"""The velocity loop drives the plant well: bounds with room."""

from __future__ import annotations

import math

import pytest

from support import control_quality as quality
from support.virtual import VirtualRobot


def test_a_step_settles_right_after_the_slew_limit_with_little_overshoot() -> None:
    step = quality.velocity_step()
    assert step.settling_s < step.slew_s + 0.1
    assert step.overshoot < 0.05


@pytest.mark.parametrize("edge_error", [0.0, quality.CRAWL_EDGE_ERROR_TICKS])
def test_crawling_is_smooth(edge_error: float) -> None:
    assert quality.crawl_ripple(0.03, edge_error) < 0.05


def test_the_wheel_turns_steadily_where_a_tick_takes_29_ms() -> None:
    assert quality.crawl_ripple(0.02) < 0.05


def test_a_load_is_carried_within_a_second() -> None:
    dip, recovery_s = quality.load_step()
    assert 0.1 < dip < 0.5
    assert recovery_s < 0.6


def test_unequal_motors_drive_straight() -> None:
    assert quality.straightness() < math.radians(3)


@pytest.mark.parametrize("target", [0.1, 0.2, 0.4])
def test_a_step_hardly_overshoots_and_keeps_the_acceleration_limit(target: float) -> None:
    assert quality.velocity_step(target).overshoot < 0.06
    assert quality.acceleration(target) < 1.02


def test_following_the_path_makes_no_ripple() -> None:
    assert quality.crawl_ripple(0.03) < 0.01


@pytest.mark.parametrize(
    "settings",
    [
        {},
        {"left.motor_scale": 0.85},
        {"right.motor_scale": 0.85},
        {"left.load_nm": 0.02},
        {"right.load_nm": 0.02},
    ],
)
def test_the_figure_eight_ends_where_it_was_commanded_to_end(settings: dict[str, float]) -> None:
    end = quality.figure_eight(**settings)[-1]
    assert end.distance_m < 0.010
    assert abs(end.heading_rad) < math.radians(1)


def test_gains_of_zero_follow_velocity_alone() -> None:
    end = quality.figure_eight(quality.LAWS["feed-forward and PI"], **{"left.load_nm": 0.02})[-1]
    assert abs(end.heading_rad) > math.radians(2)


@pytest.mark.parametrize("wheels", [("left",), ("right",), ("left", "right")])
@pytest.mark.parametrize(("target", "after_s"), [(0.1, 1.5), (0.2, 1.5137), (0.3, 1.5274)])
def test_an_obstacle_that_goes_away_throws_nothing_forward(
    target: float, after_s: float, wheels: tuple[str, ...]
) -> None:
    result = quality.obstacle(target, wheels, after_s)
    assert result.overshoot <= 0.25
    assert result.heading_rad < math.radians(1)


@pytest.mark.parametrize("catch_up", [0.0, 0.03])
def test_a_wheel_catches_up_no_faster_than_its_parameter_allows(
    robot: VirtualRobot, catch_up: float
) -> None:
    robot.set_parameter("path_catch_up", catch_up)
    fastest_mps = quality.catching_up(robot, 0.1)
    assert fastest_mps == pytest.approx(0.1 * (1 + catch_up), rel=0.005)


def test_no_wheel_catches_up_beyond_max_velocity(robot: VirtualRobot) -> None:
    robot.set_parameter("max_velocity_mps", 0.2)
    assert quality.catching_up(robot, 0.2) < 0.2 * 1.005


@pytest.mark.parametrize("limit_m", [0.001, 0.05])
def test_no_more_is_caught_up_than_the_error_limit(robot: VirtualRobot, limit_m: float) -> None:
    robot.set_parameter("path_error_limit_m", limit_m)
    owed_m = quality.missing_after_a_load(robot, 0.2)
    assert owed_m == pytest.approx(0, abs=0.002) if limit_m > 0.01 else owed_m > 0.004


@pytest.mark.parametrize(("held", "waits"), [("left", "right"), ("right", "left")])
def test_a_wheel_that_waited_keeps_the_acceleration_limit(
    robot: VirtualRobot, held: str, waits: str
) -> None:
    assert quality.acceleration_after_waiting(robot, held, waits) < 1.1


@pytest.mark.parametrize("target", [0.4, 0.1, 0.03, -0.2])
def test_no_steady_error(robot: VirtualRobot, target: float) -> None:
    robot.drive(target, target, 3.0)
    assert robot.sim.get("true.left_mps") == pytest.approx(target, rel=0.03)


@pytest.mark.parametrize("rate_hz", [200, 5000])
def test_the_same_at_another_control_rate(robot: VirtualRobot, rate_hz: int) -> None:
    robot.set_parameter("control_rate_hz", rate_hz)
    robot.drive(0.3, 0.3, 2.0)
    assert robot.sim.get("true.left_mps") == pytest.approx(0.3, rel=0.03)


def test_acceleration_keeps_the_curvature_of_the_path(robot: VirtualRobot) -> None:
    for _ in range(15):
        robot.drive(0.1, 0.4, 0.02)
        left, right = robot.sim.get("true.left_mps"), robot.sim.get("true.right_mps")
    turned = robot.sim.get("true.heading_rad") * 0.2
    travelled = robot.sim.get("true.x_m")
    assert right > 3 * left
    assert turned / travelled == pytest.approx((0.4 - 0.1) / 0.25, rel=0.15)
