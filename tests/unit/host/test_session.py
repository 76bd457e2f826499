import pytest

from support.fake_device import FakeDevice
from support.virtual_line import VirtualLine
from wheelwire.errors import DeviceRefused, LinkLost, ProtocolMismatch, RequestTimeout
from wheelwire.faultline import Faults
from wheelwire.session import Phase
from wheelwire_protocol.codec import message_id
from wheelwire_protocol.codes import RefusalCode, StopMode, SupervisorEvent, SupervisorState
from wheelwire_protocol.schema import schema_hash
from wheelwire_protocol.types import (
    Ack,
    ClearEstop,
    Hello,
    ParameterGet,
    ParameterSet,
    ParameterValue,
    Ping,
    Refuse,
    SetStreamRate,
    SetWheelVelocity,
    Stop,
)


def test_a_session_opens_with_a_known_clock_rate_and_parameters() -> None:
    line = VirtualLine(stream_rate_hz=200, watched=(1, 6)).open()
    assert line.device.rate_hz == 200
    assert line.session.values == pytest.approx({1: 0.033, 6: 0.4})
    assert len(line.sent_of(Ping)) >= 8
    assert line.session.device is not None
    assert line.session.device.release.release == "9.8.7"
    assert line.session.device.board_id == "240ac4123456"


def test_hello_is_repeated_with_one_nonce_until_answered() -> None:
    line = VirtualLine()
    line.device.mute = True
    line.session.connect(line.now_us)
    line.run(0.45)
    hellos = line.sent_of(Hello)
    assert len(hellos) == 5
    assert len(set(hellos)) == 1
    line.device.mute = False
    line.wait_open()


@pytest.mark.parametrize("difference", ["protocol_version", "schema_hash"])
def test_a_mismatch_names_both_sides_and_opens_nothing(difference: str) -> None:
    device = FakeDevice()
    setattr(device, difference, 77)
    line = VirtualLine(device=device)
    line.session.connect(line.now_us)
    line.run_until(lambda: isinstance(line.session.error, ProtocolMismatch))
    text = str(line.session.error)
    assert "9.8.7" in text
    assert f"{schema_hash():08x}" in text
    assert f"{device.schema_hash:08x}" in text
    assert f"protocol {device.protocol_version}" in text
    with pytest.raises(ProtocolMismatch):
        line.drive()
    assert line.sent_of(SetWheelVelocity) == []


def test_a_booting_device_is_greeted_again() -> None:
    device = FakeDevice(booting=True)
    line = VirtualLine(device=device)
    line.session.connect(line.now_us)
    line.run(0.25)
    assert len(line.sent_of(Hello)) == 3
    with pytest.raises(LinkLost, match="starting"):
        line.drive()
    device.booting = False
    line.wait_open()


def test_answers_of_another_session_are_ignored_and_counted() -> None:
    line = VirtualLine(watched=(1,)).open()
    foreign = line.session.statistics(line.now_us).foreign
    other = line.device.session_id ^ 1
    line.device.send(ParameterValue(other, 1, 1, 99.0))
    line.device.send(Refuse(other, message_id(SetWheelVelocity), RefusalCode.ESTOPPED, 1))
    line.run(0.01)
    assert line.session.statistics(line.now_us).foreign == foreign + 2
    assert line.session.values[1] == pytest.approx(0.033)
    line.drive()


def test_an_answer_to_a_request_that_was_given_up_is_no_value() -> None:
    line = VirtualLine().open()
    outcomes: list[object] = []
    line.device.mute = True
    line.session.request(ParameterGet(0, 0, 1), outcomes.append, line.now_us)
    line.run_until(lambda: bool(outcomes))
    assert isinstance(outcomes[0], RequestTimeout)
    line.device.mute = False
    line.device.send(ParameterValue(line.device.session_id, 1, 1, 5.0))
    line.run(0.05)
    assert len(outcomes) == 1


def test_a_request_is_repeated_unchanged_and_done_once() -> None:
    line = VirtualLine().open()
    line.to_host.faults.loss = 1.0
    outcomes: list[object] = []
    line.session.request(ParameterSet(0, 0, 6, 0.25), outcomes.append, line.now_us)
    line.run(0.5)
    line.to_host.faults.loss = 0.0
    line.run_until(lambda: bool(outcomes))
    copies = line.sent_of(ParameterSet)
    assert len(copies) >= 3
    assert len(set(copies)) == 1
    assert len([m for m in line.device.done if isinstance(m, ParameterSet)]) == 1
    assert isinstance(outcomes[0], ParameterValue)
    assert line.session.statistics(line.now_us).requests_repeated == len(copies) - 1


def test_requests_go_one_at_a_time_in_order() -> None:
    line = VirtualLine().open()
    outcomes: list[object] = []
    line.device.mute = True
    for parameter in (1, 2, 3):
        line.session.request(ParameterGet(0, 0, parameter), outcomes.append, line.now_us)
    line.run(0.3)
    assert {m.parameter for m in line.sent_of(ParameterGet) if isinstance(m, ParameterGet)} == {1}
    line.device.mute = False
    line.run_until(lambda: len(outcomes) == 3)
    assert [o.parameter for o in outcomes if isinstance(o, ParameterValue)] == [1, 2, 3]


def test_a_stop_overtakes_a_request_that_waits() -> None:
    line = VirtualLine().open()
    line.to_device.faults.loss = 1.0
    line.session.request(ParameterGet(0, 0, 1), lambda _: None, line.now_us)
    line.run(0.05)
    line.to_device.faults.loss = 0.0
    outcomes: list[object] = []
    line.session.stop(StopMode.BRAKE, outcomes.append, line.now_us)
    line.run_until(lambda: bool(outcomes), patience_s=0.1)
    assert isinstance(outcomes[0], Ack)


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


def test_a_reset_is_followed_by_a_new_session_and_told_meanwhile() -> None:
    line = VirtualLine(stream_rate_hz=50, watched=(1,)).open()
    line.drive()
    outcomes: list[object] = []
    line.device.reset()
    line.session.request(ParameterGet(0, 0, 2), outcomes.append, line.now_us)
    line.run_until(lambda: line.session.phase is not Phase.OPEN)
    with pytest.raises(LinkLost, match="session"):
        line.drive()
    assert isinstance(outcomes[0], LinkLost)
    line.wait_open()
    assert line.samples[-1].boot_id == line.device.boot_id
    statistics = line.session.statistics(line.now_us)
    assert (statistics.sessions, statistics.device_resets) == (2, 1)
    line.drive()
    line.run(0.05)
    assert line.device.obeyed[-1].command_seq == 1


def test_the_reset_of_a_robot_that_nobody_drives_is_found_soon() -> None:
    line = VirtualLine().open()
    line.device.reset()
    line.run_until(lambda: line.session.phase is not Phase.OPEN, patience_s=0.12)
    line.wait_open()


def test_pings_are_half_a_second_apart_while_states_come() -> None:
    line = VirtualLine().open()
    pings = len(line.sent_of(Ping))
    line.run(10.0)
    assert len(line.sent_of(Ping)) - pings == pytest.approx(20, abs=1)


def test_a_state_frame_of_another_boot_is_followed_by_a_hello_at_once() -> None:
    line = VirtualLine().open()
    state = line.device.state(line.now_us)
    line.device.send(state._replace(boot_id=state.boot_id ^ 1))
    hellos = len(line.sent_of(Hello))
    line.run(0.002)
    assert len(line.sent_of(Hello)) == hellos + 1


def test_a_late_state_frame_of_a_former_boot_changes_nothing() -> None:
    line = VirtualLine().open()
    late = line.device.state(line.now_us)
    line.device.reset()
    line.run_until(lambda: line.session.phase is not Phase.OPEN)
    line.wait_open()
    count = len(line.samples)
    sessions = line.session.statistics(line.now_us).sessions
    line.device.rate_hz = 0
    line.device.send(late)
    line.run(0.05)
    assert line.session.phase is Phase.OPEN
    assert line.session.statistics(line.now_us).sessions == sessions
    assert len(line.samples) - count <= 1
    assert line.samples[-1].boot_id == line.device.boot_id


def test_silence_ends_the_session_and_the_answer_opens_a_new_one() -> None:
    line = VirtualLine().open()
    line.device.mute = True
    line.run(1.9)
    assert line.session.phase is Phase.OPEN
    line.run(0.2)
    with pytest.raises(LinkLost, match="silent"):
        line.drive()
    line.device.mute = False
    line.wait_open()
    assert line.session.statistics(line.now_us).device_resets == 0


def test_a_rate_that_the_device_refuses_is_told() -> None:
    class Narrow(FakeDevice):
        def _do(self, request: object) -> object:  # type: ignore[override]
            assert isinstance(request, SetStreamRate)
            code = RefusalCode.RATE_TOO_HIGH
            ids = request.session_id, message_id(SetStreamRate)
            return Refuse(*ids, code, request.request_id)

    line = VirtualLine(device=Narrow(), stream_rate_hz=5000)
    line.session.connect(line.now_us)
    line.run_until(lambda: isinstance(line.session.error, DeviceRefused))
    assert line.session.phase is not Phase.OPEN
    hellos = len(line.sent_of(Hello))
    line.run(0.9)
    assert len(line.sent_of(Hello)) == hellos  # it does not storm the device
    line.run(0.2)
    assert len(line.sent_of(Hello)) > hellos


def test_an_answer_that_comes_twice_is_taken_once() -> None:
    line = VirtualLine(to_host=Faults(repeat=1.0, delay_us=200), watched=(1,)).open()
    foreign = line.session.statistics(line.now_us).foreign
    assert isinstance(line.request(ParameterSet(0, 0, 1, 0.05)), ParameterValue)
    line.run(0.01)
    assert line.session.statistics(line.now_us).foreign == foreign + 1
    assert line.session.values[1] == pytest.approx(0.05)


def test_pings_between_a_request_and_its_repeat_do_not_age_it() -> None:
    line = VirtualLine().open()
    line.run(0.4)
    line.to_host.faults.loss = 1.0
    answers: list[object] = []
    line.session.request(ParameterSet(0, 0, 1, 0.05), answers.append, line.now_us)
    pings = len(line.sent_of(Ping))
    line.run(0.75)
    line.to_host.faults.loss = 0.0
    line.run(0.2)
    assert len(line.sent_of(Ping)) > pings
    assert isinstance(answers[0], ParameterValue)
    assert sum(isinstance(done, ParameterSet) for done in line.device.done) == 1


def test_a_repeated_or_older_state_frame_is_no_sample() -> None:
    line = VirtualLine().open()
    line.device.rate_hz = 0
    line.run(0.05)
    count = len(line.samples)
    newer = line.device.state(line.now_us)
    older = newer._replace(t_us=newer.t_us - 5_000)
    for state in (newer, newer, older):
        line.device.send(state)
    line.run(0.01)
    assert len(line.samples) == count + 1
    assert line.session.statistics(line.now_us).stale_states == 2


def test_the_stamp_of_a_sample_is_the_hosts_time_of_its_latch() -> None:
    faults = Faults(delay_us=2_000, jitter_us=8_000)
    line = VirtualLine(to_device=faults, to_host=faults).open()
    line.run(10.0)
    for sample in line.samples:
        latched_us = sample.t_us - line.device.clock_offset_us
        assert abs(sample.stamp * 1e6 - latched_us) <= sample.stamp_error_s * 1e6 + 1


def test_disconnecting_ends_every_request() -> None:
    line = VirtualLine().open()
    outcomes: list[object] = []
    for parameter in (1, 2):
        line.session.request(ParameterGet(0, 0, parameter), outcomes.append, line.now_us)
    line.session.disconnect(LinkLost("unplugged"))
    assert [str(outcome) for outcome in outcomes] == ["unplugged"] * 2
    assert line.session.next_deadline_us is None
    with pytest.raises(LinkLost, match="unplugged"):
        line.drive()


def test_a_stop_without_a_session_is_sent_all_the_same() -> None:
    line = VirtualLine()
    line.device.mute = True
    line.session.connect(line.now_us)
    outcomes: list[object] = []
    line.session.stop(StopMode.CONFIGURED, outcomes.append, line.now_us)
    assert isinstance(outcomes[0], LinkLost)
    line.run(0.01)
    assert any(isinstance(message, Stop) for message in line.device.received)


def test_after_the_port_was_opened_again_sequence_numbers_start_anew() -> None:
    line = VirtualLine().open()
    line.run(1.0)
    line.session.disconnect(LinkLost("unplugged"))
    line.session.connect(line.now_us)
    line.wait_open()
    assert line.session.statistics(line.now_us).frames_lost == 0
    assert line.device._decoder.counters.seq_lost == 0
