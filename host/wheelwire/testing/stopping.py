"""How driving ends: by a stop, a deadline, an e-stop or a fault."""

from __future__ import annotations

import pytest

from wheelwire_protocol.codes import Fault, SupervisorState

from .. import errors
from ..samples import WheelSample
from .bench import Bench
from .harness import SPEED_MPS, DriveHarness, standing, turning

WATCHDOG_MARGIN_S = 0.15
"""Allows for one sample period and a busy machine."""


def not_driving(sample: WheelSample) -> bool:
    """Whether the robot is not in the state DRIVING."""
    return sample.state is not SupervisorState.DRIVING


class StoppingTests:
    """The supervisor, seen through the driver."""

    def test_a_stop_removes_the_drive_and_the_wheels_come_to_rest(
        self, bench: Bench, harness: DriveHarness
    ) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        harness.driver.stop()
        sample = harness.wait(not_driving)
        assert sample.state is SupervisorState.IDLE
        assert sample.left_duty == sample.right_duty == 0
        harness.wait(standing)
        assert not bench.is_driven()

    def test_a_setpoint_ends_with_its_time_to_live(
        self, bench: Bench, harness: DriveHarness
    ) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        sample = harness.time_to(
            lambda: harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.3),
            not_driving,
            0.3 + WATCHDOG_MARGIN_S,
        )
        assert sample.state is SupervisorState.TIMED_OUT
        harness.wait(standing)
        assert not bench.is_driven()

    def test_the_time_to_live_counts_from_the_stamp(self, harness: DriveHarness) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)

        def command_with_an_old_stamp() -> None:
            made = harness.next().stamp
            harness.drive(SPEED_MPS, 0.0, 0.4)
            harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=1.0, stamp=made)

        # 0.4 of the 1 s have passed when it is sent.
        sample = harness.time_to(command_with_an_old_stamp, not_driving, 0.6 + WATCHDOG_MARGIN_S)
        assert sample.state is SupervisorState.TIMED_OUT

    def test_reading_does_not_extend_a_setpoint(self, harness: DriveHarness) -> None:
        harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.3)
        start = harness.next()
        while harness.next().t_us - start.t_us < 0.6e6:
            harness.driver.get_encoder_ticks()
            assert harness.driver.geometry.wheel_radius > 0
        assert harness.next().state is SupervisorState.TIMED_OUT

    def test_a_time_to_live_is_limited(self, harness: DriveHarness) -> None:
        longest_s = harness.driver.parameters["ttl_max_s"]
        with pytest.raises(errors.InvalidCommand, match="ttl_max_s"):
            harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=1e9)
        sample = harness.time_to(
            lambda: harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=longest_s),
            not_driving,
            longest_s + WATCHDOG_MARGIN_S,
        )
        assert sample.state is SupervisorState.TIMED_OUT

    def test_a_fresh_setpoint_ends_a_time_out(self, harness: DriveHarness) -> None:
        harness.driver.set_velocity(SPEED_MPS, 0.0, ttl=0.3)
        harness.wait(lambda s: s.state is SupervisorState.TIMED_OUT)
        harness.drive_until(SPEED_MPS, 0.0, turning)

    def test_a_full_reversal_is_no_fault(self, harness: DriveHarness) -> None:
        harness.drive(0.3, 0.0, 1.0)
        # Until they turn round, the wheels are driven against their motion, as with a reversed
        # encoder.
        harness.drive(-0.3, 0.0, 1.0)
        assert harness.next().faults == Fault(0)
        assert harness.next().state is SupervisorState.DRIVING

    def test_an_estop_latches_until_it_is_cleared(self, harness: DriveHarness) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        harness.driver.estop()
        harness.wait(lambda s: s.state is SupervisorState.ESTOPPED and s.left_duty == 0)
        with pytest.raises(errors.DeviceRefused):
            harness.driver.set_velocity(SPEED_MPS, 0.0)
        harness.wait(standing)
        harness.driver.clear_estop()
        # A clear alone restarts nothing: first the robot is asked to stand.
        harness.drive_until(0.0, 0.0, lambda s: s.state is SupervisorState.DRIVING)
        harness.drive_until(SPEED_MPS, 0.0, turning)

    def test_an_encoder_that_does_not_count_is_a_fault(
        self, bench: Bench, harness: DriveHarness
    ) -> None:
        harness.drive_until(SPEED_MPS, 0.0, turning)
        bench.block_left_encoder()
        sample = self._drive_into_fault(harness)
        assert sample.faults & Fault.LEFT_NOT_COUNTING
        assert sample.left_duty == sample.right_duty == 0
        with pytest.raises(errors.DeviceRefused, match="fault"):
            harness.driver.set_velocity(SPEED_MPS, 0.0)
        harness.driver.clear_fault()
        # Zero, because the encoder is still blocked.
        harness.driver.set_velocity(0.0, 0.0)

    @staticmethod
    def _drive_into_fault(harness: DriveHarness) -> WheelSample:
        try:
            return harness.drive_until(SPEED_MPS, 0.0, lambda s: s.state is SupervisorState.FAULT)
        except errors.DeviceRefused:
            # The fault was known before a sample showed it.
            return harness.wait(lambda s: s.state is SupervisorState.FAULT)
