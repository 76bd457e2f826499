"""How driving ends: by a stop, a deadline, an e-stop, a fault."""

from __future__ import annotations

import pytest

from wheelwire_protocol.codes import Fault, SupervisorState

from .. import errors
from ..samples import WheelSample
from .bench import Bench
from .drill import SPEED_MPS, Drill, standing, turning

WATCHDOG_MARGIN_S = 0.15
"""One sample period and a busy machine."""


def not_driving(sample: WheelSample) -> bool:
    """Driving has ended, or has not begun."""
    return sample.state is not SupervisorState.DRIVING


class StoppingTests:
    """The supervisor, from outside."""

    def test_a_stop_removes_the_drive_and_the_wheels_come_to_rest(
        self, bench: Bench, drill: Drill
    ) -> None:
        drill.drive_until(SPEED_MPS, 0.0, turning)
        drill.driver.stop()
        sample = drill.wait(not_driving)
        assert sample.state is SupervisorState.IDLE
        assert sample.left_duty == sample.right_duty == 0
        drill.wait(standing)
        assert not bench.is_driven()

    def test_a_setpoint_ends_with_its_time_to_live(self, bench: Bench, drill: Drill) -> None:
        drill.drive_until(SPEED_MPS, 0.0, turning)
        sample = drill.time_to(
            lambda: drill.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.3),
            not_driving,
            0.3 + WATCHDOG_MARGIN_S,
        )
        assert sample.state is SupervisorState.TIMED_OUT
        drill.wait(standing)
        assert not bench.is_driven()

    def test_the_time_to_live_counts_from_the_stamp(self, drill: Drill) -> None:
        drill.drive_until(SPEED_MPS, 0.0, turning)

        def give_an_old_command() -> None:
            made = drill.next().stamp
            drill.drive(SPEED_MPS, 0.0, 0.8)
            drill.driver.set_velocity(SPEED_MPS, 0.0, ttl=1.4, stamp=made)

        sample = drill.time_to(give_an_old_command, not_driving, 0.6 + WATCHDOG_MARGIN_S)
        assert sample.state is SupervisorState.TIMED_OUT

    def test_reading_extends_no_setpoint(self, drill: Drill) -> None:
        drill.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.2)
        start = drill.next()
        while drill.next().t_us - start.t_us < 0.6e6:
            drill.driver.get_encoder_ticks()
            assert drill.driver.geometry.wheel_radius > 0
        assert drill.next().state is SupervisorState.TIMED_OUT

    def test_an_endless_time_to_live_is_cut_short(self, drill: Drill) -> None:
        longest_s = drill.driver.parameters["ttl_max_s"]
        sample = drill.time_to(
            lambda: drill.driver.set_velocity(SPEED_MPS, 0.0, ttl=1e9),
            not_driving,
            longest_s + WATCHDOG_MARGIN_S,
        )
        assert sample.state is SupervisorState.TIMED_OUT

    def test_a_fresh_setpoint_ends_a_time_out(self, drill: Drill) -> None:
        drill.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.1)
        drill.wait(lambda s: s.state is SupervisorState.TIMED_OUT)
        drill.drive_until(SPEED_MPS, 0.0, turning)

    def test_a_full_reversal_is_no_fault(self, drill: Drill) -> None:
        drill.drive(0.3, 0.0, 1.0)
        drill.drive(-0.3, 0.0, 1.0)
        assert drill.next().faults == Fault(0)
        assert drill.next().state is SupervisorState.DRIVING

    def test_an_estop_latches_until_it_is_cleared(self, drill: Drill) -> None:
        drill.drive_until(SPEED_MPS, 0.0, turning)
        drill.driver.estop()
        drill.wait(lambda s: s.state is SupervisorState.ESTOPPED and s.left_duty == 0)
        with pytest.raises(errors.DeviceRefused):
            drill.driver.set_velocity(SPEED_MPS, 0.0)
        drill.wait(standing)
        drill.driver.clear_estop()
        drill.drive_until(SPEED_MPS, 0.0, turning)

    def test_an_encoder_that_does_not_count_is_a_fault(self, bench: Bench, drill: Drill) -> None:
        drill.drive_until(SPEED_MPS, 0.0, turning)
        bench.block_left_encoder()
        sample = self._drive_into_fault(drill)
        assert sample.faults & Fault.LEFT_NOT_COUNTING
        assert sample.left_duty == sample.right_duty == 0
        with pytest.raises(errors.DeviceRefused, match="fault"):
            drill.driver.set_velocity(SPEED_MPS, 0.0)
        drill.driver.clear_fault()
        drill.driver.set_velocity(0.0, 0.0)

    @staticmethod
    def _drive_into_fault(drill: Drill) -> WheelSample:
        try:
            return drill.drive_until(SPEED_MPS, 0.0, lambda s: s.state is SupervisorState.FAULT)
        except errors.DeviceRefused:
            return drill.wait(lambda s: s.state is SupervisorState.FAULT)
