"""Sensors on a computer's I2C bus: the firmware's drivers beside the core as a library."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import pytest

from support.i2c_chips import INA219, MPU6050
from support.pi_robot import IMU, LEVELS, POWER, PiRobot, board_with
from wheelwire.board import (
    DigitalInput,
    PowerSensor,
)
from wheelwire.errors import DeviceRefused
from wheelwire.pi.i2c import BusReader
from wheelwire_protocol.codes import (
    ConfigurationState,
    PeripheralKind,
    Place,
    RefusalCode,
    SensorState,
    SupervisorState,
)
from wheelwire_protocol.core import Sensors, TransferResult
from wheelwire_protocol.peripherals import SensorChip
from wheelwire_protocol.types import (
    ClearFault,
    ConfigurationConfirm,
    ConfigurationGet,
    ConfigurationValue,
    ConfigurationWrite,
    Imu,
    Power,
    SensorStream,
)

IMU_CHANNEL, POWER_CHANNEL = 0, 1
ADDRESSES = {IMU_CHANNEL: MPU6050, POWER_CHANNEL: INA219}
BUMPER = DigitalInput(PeripheralKind.BUMPER, Place.FRONT, 8)
HANGS_MS = 500
REPORTED_MS = 100
"""After this a transfer that has not ended is reported."""


def streaming(robot: PiRobot) -> PiRobot:
    """Asks for samples, and reads them for a while."""
    robot.request(SensorStream(0, 0, 200))
    robot.run_ms(300)
    robot.messages.clear()
    return robot


@pytest.fixture
def robot() -> Iterator[PiRobot]:
    robot = PiRobot().start()
    robot.session.connect(robot.now_us)
    return streaming(robot.wait_open())  # type: ignore[return-value]


def drives(robot: PiRobot, milliseconds: int) -> None:
    """Drive for so long, with wheels that turn."""
    for _ in range(milliseconds // 10):
        robot.set_duty(0.3, 0.3)
        robot.left_ticks += 5
        robot.right_ticks += 5
        robot.step()
        assert robot.outputs.state is SupervisorState.DRIVING, robot.outputs.faults


def test_all_samples_arrive_though_the_steps_are_half_as_many(robot: PiRobot) -> None:
    robot.steps = 0
    robot.run_ms(1000)
    assert robot.steps == 100
    numbers = [one.sample for one in robot.of(Imu)]
    assert numbers == list(range(numbers[0], numbers[0] + 200))


def test_a_sample_was_taken_within_the_bound_of_its_stamp(robot: PiRobot) -> None:
    taken_us = []
    robot.in_transfer = lambda: taken_us.append(robot.chips.imu.taken_us)
    robot.run_ms(200)
    found = robot.of(Imu)
    assert len(found) == 40
    for one in found:
        assert any(abs(one.t_us - t_us) <= one.bound_us for t_us in taken_us)
        assert one.bound_us <= 1500


def test_nothing_is_read_before_the_core_has_started() -> None:
    robot = PiRobot()
    for _ in range(10):
        robot.poll()
    assert robot.chips.transfers == 0
    robot.open().run_ms(200)
    assert robot.chips.transfers > 0


@pytest.mark.parametrize("channel", [IMU_CHANNEL, POWER_CHANNEL])
def test_a_chip_is_unplugged_and_plugged(robot: PiRobot, channel: int) -> None:
    chip = robot.chips.by_address.pop(ADDRESSES[channel])
    robot.run_ms(500)
    assert robot.states(channel) == [SensorState.ABSENT]
    assert not robot.states(1 - channel)  # the other one goes on
    chip.power_on()  # its supply was off, too
    robot.chips.by_address[ADDRESSES[channel]] = chip
    robot.run_ms(500)
    assert robot.states(channel)[-1] is SensorState.OK


@pytest.mark.parametrize(
    ("failure", "state"),
    [
        (TransferResult.HUNG, SensorState.HUNG),
        (TransferResult.NO_ANSWER, SensorState.ABSENT),
    ],
)
def test_transfers_that_fail(robot: PiRobot, failure: TransferResult, state: SensorState) -> None:
    robot.failure = failure
    robot.run_ms(300)
    for channel in ADDRESSES:
        assert robot.states(channel)[-1] is state
    robot.failure = None
    robot.run_ms(500)
    for channel in ADDRESSES:
        assert robot.states(channel)[-1] is SensorState.OK


def test_a_transfer_that_does_not_end_delays_no_step(robot: PiRobot) -> None:
    robot.arm()
    found: list[SensorState] = []

    def hang() -> None:
        robot.in_transfer, robot.reads = lambda: None, False
        began_us, robot.steps = robot.now_us, 0
        drives(robot, HANGS_MS)
        assert robot.steps == HANGS_MS // 10
        assert robot.now_us - began_us == HANGS_MS * 1000
        found.extend(robot.states(IMU_CHANNEL))
        robot.bus_us, robot.reads = robot.now_us, True

    robot.in_transfer = hang
    drives(robot, 300)
    # First nothing came; then it was known why.
    assert found == [SensorState.MISSED, SensorState.HUNG]
    robot.run_ms(500)
    assert robot.states(IMU_CHANNEL)[-1] is SensorState.OK
    assert robot.states(POWER_CHANNEL)[-1] is SensorState.OK


def test_a_slow_transfer_does_not_count_as_hung(robot: PiRobot) -> None:
    def take_time() -> None:
        robot.in_transfer, robot.reads = lambda: None, False
        robot.run_ms(REPORTED_MS - 20)
        robot.bus_us, robot.reads = robot.now_us, True

    robot.in_transfer = take_time
    robot.run_ms(500)
    assert robot.states(IMU_CHANNEL) == [SensorState.MISSED, SensorState.OK]


def test_a_transfer_that_began_after_the_step_does_not_count_as_hung(robot: PiRobot) -> None:
    def step_late() -> None:
        robot.in_transfer, robot.reads = lambda: None, False
        robot.bus_us += 50_000
        robot.run_ms(30)
        robot.reads = True

    robot.in_transfer = step_late
    robot.bus_us += 50_000
    robot.run_ms(500)
    assert SensorState.HUNG not in robot.states(IMU_CHANNEL)


def test_a_slow_read_is_not_used(robot: PiRobot) -> None:
    def take_time() -> None:
        robot.bus_us += 25_000

    robot.in_transfer = take_time
    robot.run_ms(500)
    assert robot.states(IMU_CHANNEL)[-1] is SensorState.MISSED
    robot.messages.clear()
    robot.run_ms(500)
    assert not robot.of(Imu)


def test_one_late_step_without_a_sample_is_no_fault(robot: PiRobot) -> None:
    for _ in range(20):
        robot.reads = False
        robot.now_us += 5_000
        robot.step()  # three of the IMU's periods after the one before
        robot.reads = True
        robot.run_ms(20)
    assert not robot.states(IMU_CHANNEL)


def test_a_transfer_that_raises_counts_as_hung(
    robot: PiRobot, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail() -> None:
        raise RuntimeError("nobody thought of this")

    robot.in_transfer = fail
    robot.run_ms(300)
    assert robot.states(IMU_CHANNEL)[-1] is SensorState.HUNG
    assert "nobody thought of this" in capfd.readouterr().err


def test_half_an_answer_counts_as_no_answer(robot: PiRobot) -> None:
    robot.failure = TransferResult.DONE  # with no bytes
    robot.run_ms(300)
    assert robot.states(IMU_CHANNEL)[-1] is SensorState.HUNG


def test_an_empty_battery_stops_the_next_process_too() -> None:
    records = [b""]

    def keep(record: bytes) -> bool:
        records.append(record)
        return True

    before = PiRobot(IMU, POWER, LEVELS)
    before.core.keep_latches(b"", keep)
    before.open()
    before.run_ms(300)
    before.chips.power.millivolts = 9_500
    with pytest.raises(AssertionError):
        drives(before, 3000)
    after = PiRobot(IMU, POWER, LEVELS)
    after.core.keep_latches(records[-1], keep)
    after.chips.power.millivolts = 10_600  # above the warning's level, but not by a 32nd
    after.open()
    after.run_ms(15_000)
    with pytest.raises(DeviceRefused, match="still present"):
        after.request(ClearFault(0, 0))
    after.chips.power.millivolts = 11_000
    after.run_ms(11_000)
    after.request(ClearFault(0, 0))
    assert after.outputs.faults == 0


def test_a_host_reads_the_list_and_cannot_write_it(robot: PiRobot) -> None:
    value = cast("ConfigurationValue", robot.request(ConfigurationGet(0, 0)))
    board = board_with(IMU, POWER)
    assert value.state == ConfigurationState.STORED
    assert (value.peripheral_count, value.fingerprint) == (2, board.fingerprint())
    for message in (
        ConfigurationWrite(0, 0, 2, value.fingerprint),
        ConfigurationConfirm(0, 0, value.fingerprint),
    ):
        with pytest.raises(DeviceRefused) as refused:
            robot.request(message)
        assert refused.value.code == RefusalCode.NOT_SUPPORTED


def test_a_list_that_cannot_be_read_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot be read"):
        Sensors(board_with(IMU).packed()[:-1])


def test_each_bus_has_a_reader_of_its_own() -> None:
    other = PowerSensor(SensorChip.INA219, None, None, 100.0, bus=3)
    robot = PiRobot(IMU, other).open()
    robot.request(SensorStream(0, 0, 200))
    robot.run_ms(300)
    addresses: list[int] = []

    def transfer(address: int, out: bytes, size: int) -> tuple[TransferResult, bytes]:
        addresses.append(address)
        return TransferResult.DONE, robot.chips.transfer(address, out, size) or b""

    # The second bus was not read: of its chip nothing is known, and the first one's goes on.
    assert not robot.of(Power)
    assert len(robot.of(Imu)) > 10
    second = BusReader(robot.sensors, 3, transfer, lambda: robot.now_us)
    for _ in range(100):
        second.poll()
        robot.step()
    assert set(addresses) == {INA219}
    assert robot.of(Power)[-1].voltage_mv == 11_400
