"""Opening a robot arms it: one zero setpoint, which no reconnection sends."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from support.command import run
from support.core_device import CoreDevice
from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire.cli.address import Address
from wheelwire.drivers.mock import MockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import DeviceRefused
from wheelwire.robot.robot import opened_to_look
from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import RefusalCode, SupervisorState
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import Hello, Refuse, SetDuty, SetWheelVelocity


def setpoints(device: PtyDevice) -> list[tuple[float, ...]]:
    """Left and right of each setpoint that has arrived."""
    return [message[-2:] for message in device.device.asked(SetWheelVelocity)]


class BadLine:
    """The core behind a line on which the first setpoints are lost, or refused in its place."""

    def __init__(self, device: CoreDevice, losses: int, code: RefusalCode | None = None) -> None:
        self._device, self._losses, self._code = device, losses, code
        self._decoder, self._encoder = Decoder(), Encoder()
        self.advance, self.take_output = device.advance, device.take_output

    def feed(self, data: bytes, now_us: int) -> None:
        for message in self._decoder.feed(data):
            if not isinstance(message, SetWheelVelocity) or not self._losses:
                self._device.feed(self._encoder.encode(message), now_us)
                continue
            self._losses -= 1
            if self._code is not None:
                refused = message_id(SetWheelVelocity), self._code, message.command_seq
                self._device.send(Refuse(message.session_id, *refused))


def test_opening_sends_one_zero_setpoint_and_leaves_the_robot_in_idle(device: PtyDevice) -> None:
    with SerialDriver(str(device.path)) as robot:
        assert setpoints(device) == [(0.0, 0.0)]
        assert [type(m) for m in device.device.obeyed] == [SetWheelVelocity]
        # A change of it is refused in DRIVING.
        robot.parameters.set("control_rate_hz", 200)
        assert robot.read().state is SupervisorState.IDLE
        assert robot.statistics.refused == 0


def test_a_robot_that_is_opened_to_look_gets_no_setpoint(device: PtyDevice) -> None:
    with opened_to_look(), SerialDriver(str(device.path)) as robot:
        robot.read()
    assert device.device.count(SetWheelVelocity, SetDuty) == 0
    with SerialDriver(str(device.path)):
        pass
    assert setpoints(device) == [(0.0, 0.0)]


@pytest.mark.parametrize(
    ("losses", "code"), [(1, None), (2, None), (4, None), (6, RefusalCode.BOOTING)]
)
def test_a_zero_that_is_lost_or_comes_before_the_sensors_are_read_is_sent_again(
    tmp_path: Path, losses: int, code: RefusalCode | None
) -> None:
    core = CoreDevice()
    line = BadLine(core, losses, code)
    with PtyDevice(tmp_path / "port", core, before=line), SerialDriver(str(tmp_path / "port")):
        # On a busy computer one that arrived is mistaken for a lost one now and then.
        assert {m[-2:] for m in core.obeyed} == {(0.0, 0.0)}


def test_a_refused_zero_is_sent_once_and_does_not_fail_the_first_setpoint(tmp_path: Path) -> None:
    core = CoreDevice()
    line = BadLine(core, 1, RefusalCode.BOARD_UNCONFIRMED)
    with (
        PtyDevice(tmp_path / "port", core, before=line),
        SerialDriver(str(tmp_path / "port")) as robot,
    ):
        assert core.obeyed == []
        robot.set_wheel_velocity(0.0, 0.0)
        robot.set_wheel_velocity(0.1, 0.1)
        wait_until(lambda: len(core.obeyed) == 2)


def test_a_command_that_drives_nothing_arms_nothing(device: PtyDevice) -> None:
    address = Address(str(device.path))
    address.open().close()
    address.open(bare=True).close()
    address.open_to_look().close()
    assert setpoints(device) == []
    with address.open(drives=True):
        assert setpoints(device) == [(0.0, 0.0)]
    device.device.forget()
    for command in (("info",), ("params", "list"), ("clear",), ("stop",)):
        assert run(*command, str(device.path)).returncode == 0
    assert device.device.count(Hello) >= 4
    assert setpoints(device) == []


def test_a_device_that_never_obeys_is_opened_all_the_same(tmp_path: Path) -> None:
    core = CoreDevice()
    line = BadLine(core, 1_000_000)
    with (
        PtyDevice(tmp_path / "port", core, before=line),
        SerialDriver(str(tmp_path / "port")) as robot,
    ):
        assert robot.is_open


@pytest.mark.parametrize("happening", ["reset", "replaced"])
def test_a_reconnection_sends_no_zero(
    device: PtyDevice, robot: SerialDriver, happening: str
) -> None:
    device.device.forget()
    opened = robot.sessions
    if happening == "reset":
        device.device.reset()
    else:
        device.replace(CoreDevice(seed=2))
    wait_until(lambda: robot.sessions > opened and robot.is_open)
    robot.stop()  # whatever was sent before it has arrived
    assert setpoints(device) == []


def test_a_latched_robot_opens_without_a_word(
    device: PtyDevice, caplog: pytest.LogCaptureFixture
) -> None:
    device.device.estop(time.monotonic_ns() // 1000)
    with SerialDriver(str(device.path)) as robot:
        assert device.device.obeyed == []
        assert not caplog.records
        assert robot.read().state is SupervisorState.ESTOPPED
        robot.clear_estop()
        robot.set_wheel_velocity(0.1, 0.1)
        # What came before the clear arms nothing.
        with pytest.raises(DeviceRefused) as refused:
            wait_until(lambda: robot.set_wheel_velocity(0.1, 0.1))
        assert refused.value.code == RefusalCode.UNARMED


@pytest.mark.parametrize("realtime", [True, False])
def test_a_simulated_robots_first_setpoint_drives(realtime: bool) -> None:
    with MockDriver(realtime=realtime) as robot:
        assert robot.read().command_seq == 1
        robot.set_velocity(0.2, 0.0)
        wait_until(lambda: robot.read().left_mps > 0.1)
