"""The tests that every device must pass, simulated or real, as seen by a host."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise

import pytest

from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.info import host_release
from wheelwire.link.sample_stream import SampleIterator
from wheelwire.samples import WheelSample
from wheelwire_protocol.codes import Capability, ResetReason, SupervisorState

TIMEOUT_S = 30.0
WATCH_S = 2.0
TTL_S = 0.9
CLOCK_ERROR_US = 5000


@dataclass(frozen=True)
class Bench:
    """A device, and what may be done to it.

    Attributes:
        port: Its port.
        reset: Resets the chip; None if that is not possible.
        wheels_free: Whether the wheels may turn: the robot stands on blocks.
        lossy: Whether the line loses frames on purpose.
    """

    port: str
    reset: Callable[[], object] | None
    wheels_free: bool = False
    lossy: bool = False

    @contextmanager
    def robot(self) -> Iterator[SerialDriver]:
        """The device, with no e-stop or fault latched by an earlier test."""
        with SerialDriver(self.port, connect_timeout=TIMEOUT_S) as robot:
            state = robot.read().state
            if state is SupervisorState.ESTOPPED:
                robot.clear_estop()
            if state is SupervisorState.FAULT:
                robot.clear_fault()
            if state in (SupervisorState.ESTOPPED, SupervisorState.FAULT):
                robot.set_velocity(0.0, 0.0)  # a clear alone restarts nothing
            yield robot

    def restart(self) -> None:
        """Reset the chip, with the port closed."""
        if self.reset is None:
            pytest.skip("this port has no reset line")
        self.reset()


def wait(robot: SerialDriver, condition: Callable[[WheelSample], bool]) -> WheelSample:
    """The first sample from now on that fulfils `condition`."""
    end = time.monotonic() + TIMEOUT_S
    while time.monotonic() < end:
        sample = robot.read()
        if condition(sample):
            return sample
    raise AssertionError("no such sample")


def in_time(samples: SampleIterator[WheelSample]) -> Iterator[WheelSample]:
    """The samples, for a limited time."""
    end = time.monotonic() + TIMEOUT_S
    for sample in samples:
        assert time.monotonic() < end, "no such sample"
        yield sample


def watch(robot: SerialDriver) -> list[WheelSample]:
    """The samples in a span of the device's time."""
    samples = [robot.read()]
    while samples[-1].t_us < samples[0].t_us + WATCH_S * 1e6:
        samples.append(robot.read())
    return samples


class DeviceContract:
    """A test class inherits this and brings a fixture `bench`."""

    def test_hello_tells_who_it_is(self, bench: Bench) -> None:
        with bench.robot() as robot:
            device = robot.info.device
        assert device.release.schema_hash == host_release().schema_hash
        assert int(device.board_id, 16) != 0
        assert device.reset_reason is not ResetReason.UNKNOWN

    def test_states_come_at_their_rate(self, bench: Bench) -> None:
        with bench.robot() as robot:
            period_us = 1e6 / robot.parameters["stream_rate_hz"]
            lost = robot.statistics.frames_lost
            samples = watch(robot)
            assert bench.lossy or robot.statistics.frames_lost == lost
        steps = [later.t_us - earlier.t_us for earlier, later in pairwise(samples)]
        assert statistics.median(steps) == pytest.approx(period_us, rel=0.02)
        assert samples[-1].overruns == samples[0].overruns

    def test_the_devices_clock_is_known(self, bench: Bench) -> None:
        with bench.robot() as robot:
            wait(robot, lambda _: robot.statistics.clock_error_us < CLOCK_ERROR_US)

    def test_an_expired_setpoint_ends_the_drive(self, bench: Bench) -> None:
        with bench.robot() as robot:
            samples = robot.samples()
            robot.set_wheel_velocity(0.0, 0.0, ttl=TTL_S)
            driving: list[WheelSample] = []
            for sample in in_time(samples):
                if sample.state is SupervisorState.DRIVING:
                    driving.append(sample)
                elif driving:
                    break
        assert sample.state is SupervisorState.TIMED_OUT
        assert sample.left_duty == sample.right_duty == 0.0
        # Every state that shows it lies within its life, whichever states were lost on the way.
        assert driving[-1].t_us - driving[0].t_us <= TTL_S * 1e6

    def test_an_estop_lasts_until_it_is_cleared(self, bench: Bench) -> None:
        with bench.robot() as robot:
            robot.estop()
            wait(robot, lambda sample: sample.state is SupervisorState.ESTOPPED)
            robot.clear_estop()
            wait(robot, lambda sample: sample.state is SupervisorState.IDLE)

    def test_a_restart_is_reported(self, bench: Bench) -> None:
        with bench.robot() as robot:
            before = robot.info.device
        bench.restart()
        with bench.robot() as robot:
            after = robot.info.device
        assert after.board_id == before.board_id
        assert after.boot_id != before.boot_id
        # An ESP32's EN pin is as good as its power.
        assert after.reset_reason in {ResetReason.EXTERNAL, ResetReason.POWER_ON}

    def test_saved_parameters_outlive_a_restart(self, bench: Bench) -> None:
        with bench.robot() as robot:
            value = robot.parameters["brake_time_s"]
            other = 0.25 if value != 0.25 else 0.5
            robot.parameters.set("brake_time_s", other)
            robot.parameters.save()
        try:
            bench.restart()
            with bench.robot() as robot:
                assert robot.parameters["brake_time_s"] == other
        finally:
            with bench.robot() as robot:
                robot.parameters.set("brake_time_s", value)
                robot.parameters.save()

    def test_the_wheels_follow_and_stop(self, bench: Bench) -> None:
        with bench.robot() as robot:
            simulated = Capability.SIMULATED_PLANT in robot.info.device.capabilities
            if not (simulated or bench.wheels_free):
                pytest.skip("put the robot on blocks and give --wheels-free")
            before = robot.read()
            robot.set_wheel_velocity(0.1, 0.1, ttl=0.9)
            wait(robot, lambda sample: sample.t_us > before.t_us + 800_000)
            driven = robot.read()
            assert (driven.left_mps, driven.right_mps) == pytest.approx((0.1, 0.1), abs=0.03)
            assert not driven.faults
            travel = driven.since(before)
            assert min(travel.left, travel.right) > 0
            robot.stop()
            wait(robot, lambda sample: sample.left_mps == sample.right_mps == 0.0)
