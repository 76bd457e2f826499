"""The velocity loop drives the plant well: bounds with room, the figures are in `make bench`."""

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


@pytest.mark.parametrize("target", [0.4, 0.1, 0.03, -0.2])
def test_no_steady_error(target: float) -> None:
    robot = VirtualRobot().open()
    robot.drive(target, target, 3.0)
    assert robot.sim.get("true.left_mps") == pytest.approx(target, rel=0.03)


@pytest.mark.parametrize("rate_hz", [200, 5000])
def test_the_same_at_another_control_rate(rate_hz: int) -> None:
    robot = VirtualRobot().open()
    robot.set_parameter("control_rate_hz", rate_hz)
    robot.drive(0.3, 0.3, 2.0)
    assert robot.sim.get("true.left_mps") == pytest.approx(0.3, rel=0.03)


def test_a_new_setpoint_while_rolling_starts_from_the_speed_there_is() -> None:
    robot = VirtualRobot().open()
    robot.drive(0.3, 0.3, 1.0)
    robot.stop()
    robot.run(0.03)
    before = robot.sim.get("true.left_mps")
    robot.drive(0.3, 0.3, 0.1)
    assert robot.sim.get("true.left_mps") > before


def test_acceleration_keeps_the_curvature_of_the_path() -> None:
    robot = VirtualRobot().open()
    for _ in range(15):
        robot.drive(0.1, 0.4, 0.02)
        left, right = robot.sim.get("true.left_mps"), robot.sim.get("true.right_mps")
    turned = robot.sim.get("true.heading_rad") * 0.2
    travelled = robot.sim.get("true.x_m")
    assert right > 3 * left
    assert turned / travelled == pytest.approx((0.4 - 0.1) / 0.25, rel=0.15)


def test_both_motors_and_encoders_may_be_inverted() -> None:
    wiring = {
        f"{side}.{what}_reversed": 1.0
        for side in ("left", "right")
        for what in ("motor", "encoder")
    }
    robot = VirtualRobot(1, **wiring).open()
    for side in ("left", "right"):
        robot.set_parameter(f"{side}_motor_inverted", 1)
        robot.set_parameter(f"{side}_encoder_inverted", 1)
    robot.drive(0.2, 0.3, 2.0)
    assert robot.sim.get("true.left_mps") == pytest.approx(0.2, rel=0.05)
    assert robot.sim.get("true.right_mps") == pytest.approx(0.3, rel=0.05)
    assert robot.sample.left_ticks > 0
