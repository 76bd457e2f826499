"""The simulated robot's IMU: a turn, a slip, a bus that hangs, another chip in its place."""

from __future__ import annotations

from statistics import fmean

import pytest

from support.raw import RawHost
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import SensorStale
from wheelwire_protocol.codes import SensorEventCode, SensorState
from wheelwire_protocol.peripherals import IMUS, SensorChip
from wheelwire_protocol.types import (
    Imu,
    SensorEvent,
    SensorStream,
    SetStreamRate,
    SetWheelVelocity,
    WheelState,
)

IMU = 0
"""Its channel on the default board."""
TABLE = IMUS[SensorChip.MPU6050]
PERIOD_MS = 5
SETTLE_MS = 100
RETRY_MS = 100


class ImuHost(RawHost):
    """A host that asks for all samples, of a robot whose IMU measures."""

    commands = 0

    def __init__(self, seed: int = 1, /, **settings: float) -> None:
        super().__init__(seed)
        for name, value in settings.items():
            self.sim.set(name, value)
        self.sim.reset()
        self.run_ms(100)
        self.open()
        self.send(SetStreamRate(self.session_id, 1, 100), SensorStream(self.session_id, 2, 200))
        self.run_ms(2 * SETTLE_MS)

    def yaw_rates(self) -> list[float]:
        """What was received. [rad/s]"""
        return [sample.gyro_z * TABLE.gyro_radps for sample in self.of(Imu)]

    def ms_until(self, state: SensorState) -> float:
        """Lets time pass until the device says so of the IMU; how long it took by its clock."""
        self.received.clear()
        start_us = self.device_us
        for _ in range(5000):
            self.run_ms(1)
            for event in self.of(SensorEvent):
                found = (event.channel, event.code, event.value)
                if found == (IMU, SensorEventCode.STATE, state):
                    return (event.t_us - start_us) / 1e3
        pytest.fail(f"it never was {state.name}: {self.of(SensorEvent)}")

    def drive(self, left_mps: float, right_mps: float, milliseconds: int) -> None:
        """Command 50 times a second."""
        for _ in range(milliseconds // 20):
            self.commands += 1
            expiry_us = (self.device_us + 500_000) % 2**32
            self.send(
                SetWheelVelocity(self.session_id, self.commands, expiry_us, left_mps, right_mps)
            )
            self.run_ms(20)


def test_the_yaw_rate_is_that_of_the_body_and_its_integral_the_heading() -> None:
    host = ImuHost()
    host.received.clear()
    before = host.sim.get("true.heading_rad")
    host.drive(-0.1, 0.1, 3000)
    assert host.yaw_rates()[-1] == pytest.approx(host.sim.get("true.yaw_rate_radps"), abs=0.05)
    turned = sum(host.yaw_rates()) * PERIOD_MS * 1e-3
    assert turned == pytest.approx(host.sim.get("true.heading_rad") - before, abs=0.02)
    assert turned > 2.0


def test_a_wheel_that_slips_turns_the_body_and_not_the_odometry() -> None:
    host = ImuHost(**{"left.slip": 0.3})
    host.received.clear()
    host.drive(0.2, 0.2, 3000)
    wheels = host.of(WheelState)[-1]
    assert wheels.left_ticks == pytest.approx(wheels.right_ticks, abs=20)
    expected = 0.3 * 0.2 / 0.2  # what is lost on one side, by the separation
    assert fmean(host.yaw_rates()[-200:]) == pytest.approx(expected, rel=0.05)
    assert host.sim.get("true.yaw_rate_radps") == pytest.approx(expected, rel=0.05)
    assert host.sim.get("true.left_slip") == pytest.approx(0.3)


def test_a_bus_that_hangs_leaves_the_control_steps_on_time() -> None:
    calm, hung = ImuHost(), ImuHost()
    hung.sim.set("imu.bus_hung", 1)
    assert hung.ms_until(SensorState.HUNG) <= PERIOD_MS + 2 * 5 + 2
    calm.run_ms(round((hung.device_us - calm.device_us) / 1e3))
    for host in (calm, hung):
        host.received.clear()
        host.drive(0.2, 0.25, 2000)
    assert not hung.of(Imu)
    assert hung.of(WheelState)  # the same states, at the same times
    assert hung.of(WheelState) == calm.of(WheelState)
    assert {state.overruns for state in hung.of(WheelState)} == {0}
    hung.sim.set("imu.bus_hung", 0)
    assert hung.ms_until(SensorState.OK) <= RETRY_MS + 2 * 5 + 2 * PERIOD_MS + 2


def test_the_library_names_the_chip_that_answers() -> None:
    with MockDriver(realtime=False) as robot:
        robot.sensors.start()
        assert robot.imu.read().gyro
        robot.simulator.set("imu.identity", 0x19)
        robot.simulator.set("imu.reset", 1)
        robot.advance(1.0)
        with pytest.raises(SensorStale, match="0x19, as of an MPU-6886"):
            robot.imu.read()
        (status,) = [one for one in robot.sensors.channels if one.info.name == "imu"]
        assert "0x19" in status.sentence
        robot.simulator.set("imu.identity", 0)
        robot.advance(1.0)
        assert robot.imu.read().gyro
        (status,) = [one for one in robot.sensors.channels if one.info.name == "imu"]
        assert status.identity == 0
