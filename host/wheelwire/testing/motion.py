"""Which way the wheels turn, how fast, and how both together."""

from __future__ import annotations

import pytest

from ..motion.kinematics import WheelVelocities
from .drill import CLOSE, SPEED_MPS, Drill, mean, turning

TURN_RADPS = 1.5


class MotionTests:
    """Signs, units, and the limit."""

    def test_forward_is_positive_on_both_wheels(self, drill: Drill) -> None:
        before = drill.driver.get_encoder_ticks()
        sample = drill.drive_until(SPEED_MPS, 0.0, turning)
        assert sample.left_duty > 0
        assert sample.right_duty > 0
        after = drill.driver.get_encoder_ticks()
        assert after[0] > before[0]
        assert after[1] > before[1]

    def test_backward_is_negative_on_both_wheels(self, drill: Drill) -> None:
        before = drill.driver.get_encoder_ticks()
        drill.drive_until(-SPEED_MPS, 0.0, lambda s: max(s.left_mps, s.right_mps) < -0.1)
        after = drill.driver.get_encoder_ticks()
        assert after[0] < before[0]
        assert after[1] < before[1]

    def test_counter_clockwise_is_positive_so_the_right_wheel_goes_forward(
        self, drill: Drill
    ) -> None:
        before = drill.driver.get_encoder_ticks()
        drill.drive_until(0.0, TURN_RADPS, lambda s: s.right_mps > 0.1 and s.left_mps < -0.1)
        after = drill.driver.get_encoder_ticks()
        assert after[0] < before[0]
        assert after[1] > before[1]

    def test_a_left_turn_has_the_right_wheel_faster(self, drill: Drill) -> None:
        drill.drive(SPEED_MPS, 0.5, 1.0)
        steady = drill.drive(SPEED_MPS, 0.5, 1.0)
        geometry = drill.driver.geometry
        difference = mean([s.right_mps - s.left_mps for s in steady])
        assert difference == pytest.approx(0.5 * geometry.wheel_separation, rel=2 * CLOSE)

    def test_velocities_are_in_metres_per_second(self, drill: Drill) -> None:
        drill.drive(SPEED_MPS, 0.0, 1.0)
        steady = drill.drive(SPEED_MPS, 0.0, 1.0)
        assert mean([s.left_mps for s in steady]) == pytest.approx(SPEED_MPS, rel=CLOSE)
        assert mean([s.right_mps for s in steady]) == pytest.approx(SPEED_MPS, rel=CLOSE)
        travel = steady[-1].since(steady[0])
        metres = travel.left * drill.driver.geometry.metres_per_tick
        assert metres / travel.dt_s == pytest.approx(SPEED_MPS, rel=CLOSE)

    def test_a_duty_drives_open_loop(self, drill: Drill) -> None:
        sample = drill.drive_duty(0.5, -0.5, lambda s: s.left_mps > 0.1 and s.right_mps < -0.1)
        assert sample.left_duty == pytest.approx(0.5, abs=1e-3)
        assert sample.right_duty == pytest.approx(-0.5, abs=1e-3)

    def test_both_wheels_are_slowed_by_one_factor(self, drill: Drill) -> None:
        limit = drill.driver.geometry.max_velocity_mps
        separation = drill.driver.geometry.wheel_separation
        linear, angular = limit, 1.5
        drill.drive(linear, angular, 1.5)
        steady = drill.drive(linear, angular, 1.0)
        left, right = mean([s.left_mps for s in steady]), mean([s.right_mps for s in steady])
        asked = WheelVelocities(
            linear - angular * separation / 2, linear + angular * separation / 2
        )
        assert right == pytest.approx(limit, rel=CLOSE)
        assert left / right == pytest.approx(asked.left_mps / asked.right_mps, rel=CLOSE)
