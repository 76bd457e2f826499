"""The simulated robot's IMU: what it measures, and each of its faults by name and in time."""

from __future__ import annotations

from statistics import fmean, stdev

import pytest

from support.sensing import SensingHost
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import SensorStale
from wheelwire_protocol.codes import SensorEventCode, SensorState, SupervisorState
from wheelwire_protocol.peripherals import IMUS, SensorChip
from wheelwire_protocol.types import (
    Imu,
    SensorEvent,
    SensorInfo,
    SensorStream,
    SetStreamRate,
    WheelState,
)

IMU = 0
"""Its channel on the default board."""
TABLE = IMUS[SensorChip.MPU6050]
PERIOD_MS = 5
SETTLE_MS = 100
RETRY_MS = 100


class ImuHost(SensingHost):
    """A host that asks for all samples, of a robot whose IMU measures."""

    def __init__(self, seed: int = 1, /, **settings: float) -> None:
        super().__init__(seed)
        for name, value in settings.items():
            self.sim.set(name, value)
        self.sim.reset()
        self.run_ms(100)
        self.open()
        self.send(SetStreamRate(self.session_id, 1, 100), SensorStream(self.session_id, 2, 200))
        self.run_ms(2 * SETTLE_MS)

    def identities(self) -> list[int]:
        """What another chip in the IMU's place has said it is."""
        return [
            event.value for event in self.of(SensorEvent) if event.code == SensorEventCode.IDENTITY
        ]

    def yaw_rates(self) -> list[float]:
        """What was received. [rad/s]"""
        return [sample.gyro_z * TABLE.gyro_radps for sample in self.of(Imu)]


def accelerations(host: ImuHost) -> tuple[float, float, float]:
    """The means of what was received, in the chip's axes. [m/s^2]"""
    samples = host.of(Imu)
    scale = TABLE.accelerometer_mps2
    return (
        fmean(sample.accelerometer_x for sample in samples) * scale,
        fmean(sample.accelerometer_y for sample in samples) * scale,
        fmean(sample.accelerometer_z for sample in samples) * scale,
    )


# --- what it measures ----------------------------------------------------------------------------


def test_at_rest_it_measures_gravity_and_its_own_noise() -> None:
    host = ImuHost()
    host.received.clear()
    host.run_ms(5000)
    samples = host.of(Imu)
    assert len(samples) == pytest.approx(1000, abs=2)
    x, y, z = accelerations(host)
    assert x == pytest.approx(0, abs=0.01)
    assert y == pytest.approx(0, abs=0.01)
    assert z == pytest.approx(9.80665, abs=0.01)
    assert fmean(host.yaw_rates()) == pytest.approx(0, abs=1e-4)
    noise = stdev(sample.gyro_z for sample in samples)
    assert noise == pytest.approx(TABLE.gyro_noise, rel=0.1)
    assert stdev(sample.accelerometer_x for sample in samples) == pytest.approx(
        TABLE.accelerometer_noise, rel=0.1
    )


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


def test_what_drives_forward_is_felt_in_the_axis_that_points_there() -> None:
    host = ImuHost()
    info = host.of(SensorInfo)[-1]
    assert info.channel == IMU
    host.received.clear()
    host.drive(0.3, 0.3, 200)
    _, y, _ = accelerations(host)
    speed_mps = host.sim.get("true.left_mps")
    assert y == pytest.approx(speed_mps / 0.2, rel=0.1)


def test_bias_and_noise_are_variables() -> None:
    host = ImuHost(**{"imu.bias": 0.05, "imu.noise": 4})
    host.received.clear()
    host.run_ms(5000)
    assert fmean(host.yaw_rates()) == pytest.approx(0.05, abs=1e-3)
    noise = stdev(sample.gyro_z for sample in host.of(Imu))
    assert noise == pytest.approx(4 * TABLE.gyro_noise, rel=0.1)


# --- its faults ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("variable", "state", "within_ms", "back_within_ms"),
    [
        (
            "imu.freeze",
            SensorState.FROZEN,
            (TABLE.frozen_samples + 1) * PERIOD_MS,
            RETRY_MS + SETTLE_MS + 10 * PERIOD_MS,
        ),
        (
            "imu.absent",
            SensorState.ABSENT,
            2 * PERIOD_MS + 3,
            RETRY_MS + SETTLE_MS + 2 * PERIOD_MS + 3,
        ),
        ("imu.interrupt_lost", SensorState.MISSED, 3 * PERIOD_MS + 1, 2 * PERIOD_MS + 2),
    ],
)
def test_a_fault_has_its_name_in_time_and_ends(
    variable: str, state: SensorState, within_ms: int, back_within_ms: int
) -> None:
    host = ImuHost()
    host.sim.set(variable, 1)
    assert host.ms_until(state) <= within_ms
    host.received.clear()
    host.run_ms(1000)
    assert not host.of(Imu)
    host.sim.set(variable, 0)
    assert host.ms_until(SensorState.OK) <= back_within_ms


def test_a_robot_without_the_chip_says_so_and_drives() -> None:
    host = ImuHost(**{"imu.absent": 1})
    (info,) = [info for info in host.of(SensorInfo) if info.channel == IMU]
    assert info.state == SensorState.ABSENT
    host.drive(0.2, 0.2, 1000)
    assert host.sim.state is SupervisorState.DRIVING


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


def test_another_chip_says_in_each_session_what_it_is() -> None:
    host = ImuHost(1, **{"imu.identity": 0x19})
    assert host.identities() == [0x19]
    host.received.clear()
    host.hello(nonce=7)  # the session is another one
    host.open()
    host.send(SensorStream(host.session_id, 2, 200))
    host.run_ms(100)
    assert host.identities() == [0x19]
    assert not host.of(Imu)


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
