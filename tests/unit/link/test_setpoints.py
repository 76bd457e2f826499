import pytest

from support.core_device import CoreDevice
from support.virtual_line import VirtualLine
from wheelwire.errors import DeviceRefused, Expired
from wheelwire.simulation.bad_line import Impairment
from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import Fault, RefusalCode, StopMode, SupervisorState
from wheelwire_protocol.types import (
    Ack,
    ClearEstop,
    ClearFault,
    Estop,
    Event,
    Refuse,
    SetWheelVelocity,
    Stop,
    WheelState,
)


def refusal(line: VirtualLine) -> int | None:
    """The code for which the host refuses a setpoint that it is asked for."""
    try:
        line.drive()
    except DeviceRefused as refused:
        return refused.code
    return None


def lose_a_setpoint(line: VirtualLine, ttl_s: float = 0.5) -> None:
    """On its way to the device."""
    line.to_device.impairment.loss = 1.0
    line.drive(ttl_s=ttl_s)
    line.write()
    line.to_device.impairment.loss = 0.0


def test_a_setpoint_is_sent_once_when_it_is_seen_to_be_obeyed(line: VirtualLine) -> None:
    line.drive()
    line.run(0.3)
    assert len(line.sent_of(SetWheelVelocity)) == 1
    assert line.statistics.setpoints_repeated == 0


def test_a_setpoint_that_was_lost_is_sent_again_with_its_own_expiry(line: VirtualLine) -> None:
    lose_a_setpoint(line, ttl_s=0.4)
    line.run(0.4)
    copies = line.sent_of(SetWheelVelocity)
    assert len(copies) == 2
    assert copies[0] == copies[1]
    assert len(line.device.obeyed) == 1


def test_a_program_may_drive_as_soon_as_the_clear_is_confirmed(line: VirtualLine) -> None:
    line.post_stop(None)
    line.run_until(lambda: line.session.setpoints.supervisor is SupervisorState.ESTOPPED)
    line.device.lost |= {Event, WheelState}  # the answer alone says so
    told: list[object] = []

    def drive(answer: object) -> None:
        told.append(answer)
        line.drive()

    line.session.request(ClearEstop(0, 0), drive, line.now_us)
    line.run(0.1)
    assert [type(answer) for answer in told] == [Ack]
    assert len(line.sent_of(SetWheelVelocity)) == 1


def test_nothing_renews_a_setpoint(line: VirtualLine) -> None:
    line.drive(ttl_s=0.3)
    begin_us = line.now_us
    line.run_until(lambda: line.device.supervisor is SupervisorState.TIMED_OUT)
    assert line.now_us - begin_us == pytest.approx(300_000, abs=2_000)
    line.run(2.0)
    assert len(line.device.obeyed) == 1


def test_a_setpoint_that_expired_before_its_repeat_is_not_repeated(line: VirtualLine) -> None:
    line.to_device.impairment.loss = 1.0
    line.drive(ttl_s=0.015)
    line.run(0.1)
    assert len(line.sent_of(SetWheelVelocity)) == 1


def test_a_setpoint_that_is_never_seen_to_be_obeyed_is_sent_twice(line: VirtualLine) -> None:
    line.device.mute = True
    line.drive(ttl_s=0.5)
    line.run(0.45)
    assert len(line.sent_of(SetWheelVelocity)) == 2


@pytest.mark.parametrize("mode", [StopMode.CONFIGURED, None])
def test_a_stop_voids_the_repeat_of_a_setpoint(line: VirtualLine, mode: StopMode | None) -> None:
    line.device.lost.add(WheelState)  # no state frame tells that anything arrived
    line.run(0.05)
    lose_a_setpoint(line)
    line.post_stop(mode)
    line.run(0.3)
    assert len(line.sent_of(SetWheelVelocity)) == 1
    assert line.sent_of(Estop if mode is None else Stop)


def test_a_stop_outdates_the_setpoints_before_it(line: VirtualLine) -> None:
    line.drive()
    line.post_stop()
    line.run(0.05)
    stop = line.sent_of(Stop)[0]
    line.drive()
    line.run(0.05)
    before, after = (setpoint.command_seq for setpoint in line.device.obeyed)
    assert before < stop.command_seq < after


@pytest.mark.parametrize("clear", [ClearEstop, ClearFault])
def test_clearing_voids_the_repeat_of_a_setpoint(
    line: VirtualLine, clear: type[ClearEstop | ClearFault]
) -> None:
    """A latched device did not get it, and would obey its copy after the clear."""
    lose_a_setpoint(line, ttl_s=0.4)
    line.run(0.005)
    line.to_host.impairment.loss = 1.0  # the answer comes late, or never
    line.post(clear(0, 0))
    line.run(0.3)
    assert line.sent_of(clear)
    assert len(line.sent_of(SetWheelVelocity)) == 1
    assert not line.device.obeyed


@pytest.mark.parametrize("news", ["refused", "obeyed"])
def test_news_of_an_older_setpoint_leaves_the_newest_its_repeat(
    line: VirtualLine, news: str
) -> None:
    line.device.lost.add(WheelState)
    line.drive()
    line.run(0.05)
    (first,) = line.device.obeyed
    lose_a_setpoint(line)
    if news == "obeyed":
        line.device.send(line.device.state)
    else:
        ids = line.device.session_id, message_id(SetWheelVelocity)
        line.device.send(Refuse(*ids, RefusalCode.EXPIRED, first.command_seq))
    line.run(0.05)
    numbers = [setpoint.command_seq for setpoint in line.device.obeyed]
    assert numbers == [first.command_seq, first.command_seq + 1]


@pytest.mark.parametrize(("out_us", "back_us"), [(200, 200), (200, 40_000), (40_000, 200)])
@pytest.mark.parametrize("drift", [-200e-6, 0, 200e-6])
def test_no_setpoint_outlives_its_ttl_however_unequal_the_two_ways(
    out_us: int, back_us: int, drift: float
) -> None:
    device = CoreDevice(drift=drift)
    ways = Impairment(delay_us=out_us), Impairment(delay_us=back_us)
    line = VirtualLine(to_device=ways[0], to_host=ways[1], device=device).open()
    for _ in range(40):
        line.drive(ttl_s=0.2)
        true_us = device.clock(line.now_us + 200_000)
        line.run(0.25)
        setpoint = device.obeyed[-1]
        assert setpoint.expiry_us <= true_us
        # What it lost is the round trip at most, and the drift of half a second.
        assert setpoint.expiry_us >= true_us - out_us - back_us - 600


def test_a_ttl_below_the_error_bound_of_the_devices_clock_is_refused() -> None:
    slow = Impairment(delay_us=20_000)
    line = VirtualLine(to_device=slow, to_host=slow).open()
    with pytest.raises(Expired, match=r"10 ms are left .*ttl.* known to 20\.\d+ ms"):
        line.drive(ttl_s=0.010)
    assert line.sent_of(SetWheelVelocity) == []
    line.drive(ttl_s=0.1)
    line.run(0.05)
    assert len(line.device.obeyed) == 1


def test_a_setpoint_that_came_too_late_is_counted_and_keeps_back_no_other(
    line: VirtualLine,
) -> None:
    line.drive(0.0, 0.0)
    line.run(0.1)
    line.device.forget()
    line.to_device.impairment.delay_us = 30_000
    line.drive(ttl_s=0.01)
    line.run(0.2)
    line.to_device.impairment.delay_us = 200
    line.drive()
    line.run(0.1)
    assert len(line.device.obeyed) == 1
    statistics = line.statistics
    assert statistics.refused == 1
    assert statistics.setpoints_expired == 1


@pytest.mark.parametrize(
    "code", [RefusalCode.UNARMED, RefusalCode.CONTRADICTION, RefusalCode.BOARD_UNCONFIRMED]
)
def test_a_setpoint_refused_for_another_reason_raises_once_at_the_next_one(
    line: VirtualLine, code: RefusalCode
) -> None:
    ids = line.device.session_id, message_id(SetWheelVelocity)
    line.device.send(Refuse(*ids, code, 1))
    line.run(0.05)
    assert refusal(line) == code
    line.drive()
    assert line.statistics.setpoints_expired == 0


@pytest.mark.parametrize("code", [RefusalCode.ESTOPPED, RefusalCode.FAULT])
def test_a_latched_device_is_sent_no_setpoint(line: VirtualLine, code: RefusalCode) -> None:
    if code is RefusalCode.FAULT:
        line.device.core.fail()
    else:
        line.device.estop(line.now_us)
    line.run(0.002)  # the event, before any state frame
    assert refusal(line) == code
    assert line.sent_of(SetWheelVelocity) == []


@pytest.mark.parametrize("mode", [StopMode.CONFIGURED, None])
def test_a_latch_that_shows_before_the_stop_is_sent_stays_known(
    line: VirtualLine, mode: StopMode | None
) -> None:
    # The copy that the caller wrote has latched the device before the port's thread has its turn.
    line.device.estop(line.now_us)
    line.run(0.002)
    line.post_stop(mode)
    assert refusal(line) == RefusalCode.ESTOPPED


@pytest.mark.parametrize("told_first", ["state", "refusal"])
def test_a_refusal_for_a_fault_names_the_fault_and_what_to_do(
    line: VirtualLine, told_first: str
) -> None:
    line.device.core.fail()
    line.device.lost.add(Event)
    faults = {"faults": Fault.LEFT_REVERSED | Fault.CONTROL_OVERRUN}
    line.device.edits[WheelState] = faults
    if told_first == "refusal":
        line.device.lost.add(WheelState)
        line.run(0.005)
        line.drive()
        line.device.lost.remove(WheelState)
    line.run(0.02)
    with pytest.raises(
        DeviceRefused, match=r"LEFT_REVERSED.*swap the motor's wires.*CONTROL_OVERRUN"
    ) as told:
        line.drive()
    assert told.value.faults == Fault.LEFT_REVERSED | Fault.CONTROL_OVERRUN


def unarmed_line() -> VirtualLine:
    """An e-stop was cleared on it."""
    line = VirtualLine().open()
    line.post_stop(None)
    line.run(0.05)
    assert isinstance(line.request(ClearEstop(0, 0)), Ack)
    return line


def refusals(line: VirtualLine, period_s: float, seconds: float) -> list[int]:
    """Ask for motion again and again; the codes that this raises."""
    codes = []
    for _ in range(round(seconds / period_s)):
        codes.append(refusal(line))
        line.run(period_s)
    return [code for code in codes if code is not None]


@pytest.mark.parametrize("period_s", [0.05, 0.1, 0.2, 0.33, 0.45])
def test_a_program_that_keeps_asking_for_motion_after_a_clear_gets_none(period_s: float) -> None:
    line = unarmed_line()
    codes = refusals(line, period_s, 5.0)
    assert not line.device.obeyed
    # All but the first call, which did not know yet.
    assert codes == [RefusalCode.UNARMED] * (round(5.0 / period_s) - 1)


@pytest.mark.parametrize("asked_s", [0.15, 0.2])
@pytest.mark.parametrize("pause_s", [0.0, 0.0003, 0.05])
def test_zero_after_a_refusal_is_sent_and_the_next_setpoint_drives(
    asked_s: float, pause_s: float
) -> None:
    """Also where the refusal of the setpoint before the zero comes after the zero was sent."""
    line = unarmed_line()
    assert refusals(line, 0.05, asked_s)
    refusal(line)
    line.run(pause_s)
    line.drive(0.0, 0.0)
    line.run(0.05)
    line.drive()
    line.run(0.05)
    assert line.device.obeyed[0].left_mps == 0.0  # type: ignore[union-attr]
    assert line.device.obeyed[-1].left_mps > 0.0  # type: ignore[union-attr]
