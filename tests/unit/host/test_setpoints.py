import pytest

from support.fake_device import FakeDevice
from support.virtual_line import VirtualLine
from wheelwire.errors import DeviceRefused
from wheelwire_protocol.codes import Fault, RefusalCode, StopMode, SupervisorEvent, SupervisorState
from wheelwire_protocol.types import (
    Ack,
    ClearEstop,
    SetWheelVelocity,
    Stop,
)


def test_a_setpoint_is_sent_once_when_it_is_seen_to_be_obeyed() -> None:
    line = VirtualLine().open()
    line.drive()
    line.run(0.3)
    assert len(line.sent_of(SetWheelVelocity)) == 1
    assert line.session.statistics(line.now_us).setpoints_repeated == 0


def test_a_setpoint_that_was_lost_is_sent_again_with_its_own_expiry() -> None:
    line = VirtualLine().open()
    line.to_device.faults.loss = 1.0
    line.drive(ttl_s=0.4)
    line.run(0.01)
    line.to_device.faults.loss = 0.0
    line.run(0.39)
    copies = line.sent_of(SetWheelVelocity)
    assert len(copies) == 2
    assert copies[0] == copies[1]
    assert len(line.device.obeyed) == 1


def test_nothing_renews_a_setpoint() -> None:
    line = VirtualLine().open()
    line.drive(ttl_s=0.3)
    begin_us = line.now_us
    line.run_until(lambda: line.device.supervisor is SupervisorState.TIMED_OUT)
    assert line.now_us - begin_us == pytest.approx(300_000, abs=2_000)
    line.run(2.0)
    assert len(line.device.obeyed) == 1


def test_a_setpoint_that_expired_before_its_repeat_is_not_repeated() -> None:
    line = VirtualLine().open()
    line.to_device.faults.loss = 1.0
    line.drive(ttl_s=0.015)
    line.run(0.1)
    assert len(line.sent_of(SetWheelVelocity)) == 1


def test_a_stop_voids_the_repeat_of_a_setpoint() -> None:
    line = VirtualLine().open()
    line.to_device.faults.loss = 1.0
    line.drive()
    line.to_device.faults.loss = 0.0
    line.session.stop(StopMode.CONFIGURED, lambda _: None, line.now_us)
    line.run(0.3)
    assert len(line.sent_of(SetWheelVelocity)) == 1
    stop = line.sent_of(Stop)[0]
    assert isinstance(stop, Stop)
    assert stop.command_seq == 1


def test_the_expiry_is_in_the_devices_clock_though_it_drifts() -> None:
    device = FakeDevice(drift=200e-6, clock_offset_us=-900_000)
    line = VirtualLine(device=device).open()
    line.run(20.0)
    line.drive(ttl_s=0.5)
    expiry_us = line.now_us + 500_000
    line.run(0.1)
    assert line.device.obeyed[0].expiry_us == pytest.approx(device.clock(expiry_us), abs=600)


def test_a_refused_setpoint_is_told_once_at_the_next_one() -> None:
    line = VirtualLine().open()
    line.to_device.faults.delay_us = 30_000
    line.drive(ttl_s=0.01)
    line.run(0.2)
    with pytest.raises(DeviceRefused) as told:
        line.drive()
    assert told.value.code == RefusalCode.EXPIRED
    line.drive()
    assert line.session.statistics(line.now_us).refused == 1


@pytest.mark.parametrize(
    ("state", "code"),
    [
        (SupervisorState.ESTOPPED, RefusalCode.ESTOPPED),
        (SupervisorState.FAULT, RefusalCode.FAULT),
    ],
)
def test_a_latched_device_is_sent_no_setpoint(state: SupervisorState, code: RefusalCode) -> None:
    line = VirtualLine().open()
    line.device.move_to(state, SupervisorEvent.ESTOP, line.now_us)
    line.run(0.002)  # the event, before any state frame
    with pytest.raises(DeviceRefused) as told:
        line.drive()
    assert told.value.code == code
    assert line.sent_of(SetWheelVelocity) == []


@pytest.mark.parametrize("told_first", ["state", "refusal"])
def test_a_refusal_for_a_fault_names_the_fault_and_what_to_do(told_first: str) -> None:
    line = VirtualLine().open()
    line.device.supervisor = SupervisorState.FAULT
    state = line.device.state(line.now_us)
    if told_first == "refusal":
        line.drive()
    line.device.send(state._replace(faults=Fault.LEFT_REVERSED | Fault.CONTROL_OVERRUN))
    line.device.rate_hz = 0
    line.run(0.005)
    with pytest.raises(DeviceRefused, match=r"LEFT_REVERSED.*swap.*CONTROL_OVERRUN") as told:
        line.drive()
    assert told.value.faults == Fault.LEFT_REVERSED | Fault.CONTROL_OVERRUN


def test_after_a_clear_the_next_setpoint_goes_at_once() -> None:
    line = VirtualLine().open()
    line.session.estop(lambda _: None, line.now_us)
    line.run(0.05)
    with pytest.raises(DeviceRefused):
        line.drive()
    assert isinstance(line.request(ClearEstop(0, 0)), Ack)
    line.drive()
    line.run(0.05)
    assert len(line.device.obeyed) == 1
