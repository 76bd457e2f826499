"""Which way the wheels turn, how fast, and how both together."""

from __future__ import annotations

import pytest

from ..motion.kinematics import WheelVelocities
from ..samples import WheelSample
from .harness import CLOSE, SPEED_MPS, DriveHarness, mean_of, turning

TURN_RADPS = 1.5


class MotionTests:
    """Signs, units, and the limit."""

    def test_forward_is_positive_on_both_wheels(self, harness: DriveHarness) -> None:
        before = harness.driver.get_encoder_ticks()
        sample = harness.drive_until(SPEED_MPS, 0.0, turning)
        assert sample.left_duty > 0
        assert sample.right_duty > 0
        after = harness.driver.get_encoder_ticks()
        assert after[0] > before[0]
        assert after[1] > before[1]

    def test_backward_is_negative_on_both_wheels(self, harness: DriveHarness) -> None:
        before = harness.driver.get_encoder_ticks()
        harness.drive_until(-SPEED_MPS, 0.0, lambda s: max(s.left_mps, s.right_mps) < -0.1)
        after = harness.driver.get_encoder_ticks()
        assert after[0] < before[0]
        assert after[1] < before[1]

    def test_counter_clockwise_is_positive_so_the_right_wheel_goes_forward(
        self, harness: DriveHarness
    ) -> None:
        before = harness.driver.get_encoder_ticks()
        harness.drive_until(0.0, TURN_RADPS, lambda s: s.right_mps > 0.1 and s.left_mps < -0.1)
        after = harness.driver.get_encoder_ticks()
        assert after[0] < before[0]
        assert after[1] > before[1]

    def test_a_left_turn_has_the_right_wheel_faster(self, harness: DriveHarness) -> None:
        separation = harness.driver.geometry.wheel_separation
        # A difference has the errors of both velocities.
        close = pytest.approx(0.5 * separation, rel=2 * CLOSE)
        harness.steady(SPEED_MPS, 0.5, lambda s: mean_of(s, "right") - mean_of(s, "left") == close)

    def test_velocities_are_in_metres_per_second(self, harness: DriveHarness) -> None:
        close = pytest.approx(SPEED_MPS, rel=CLOSE)
        metres_per_tick = harness.driver.geometry.metres_per_tick

        def as_commanded(steady: list[WheelSample]) -> bool:
            travel = steady[-1].since(steady[0])
            by_ticks = travel.left * metres_per_tick / travel.dt_s
            return all(
                v == close for v in (mean_of(steady, "left"), mean_of(steady, "right"), by_ticks)
            )

        harness.steady(SPEED_MPS, 0.0, as_commanded)

    def test_a_duty_drives_open_loop(self, harness: DriveHarness) -> None:
        sample = harness.drive_duty(0.5, -0.5, lambda s: s.left_mps > 0.1 and s.right_mps < -0.1)
        assert sample.left_duty == pytest.approx(0.5, abs=1e-3)
        assert sample.right_duty == pytest.approx(-0.5, abs=1e-3)

    def test_both_wheels_are_slowed_by_one_factor(self, harness: DriveHarness) -> None:
        limit = harness.driver.geometry.max_velocity_mps
        separation = harness.driver.geometry.wheel_separation
        linear, angular = limit, 1.5
        asked = WheelVelocities(
            linear - angular * separation / 2, linear + angular * separation / 2
        )
        ratio = pytest.approx(asked.left_mps / asked.right_mps, rel=CLOSE)

        def as_commanded(steady: list[WheelSample]) -> bool:
            left, right = mean_of(steady, "left"), mean_of(steady, "right")
            return right == pytest.approx(limit, rel=CLOSE) and left / right == ratio

        harness.steady(linear, angular, as_commanded)
