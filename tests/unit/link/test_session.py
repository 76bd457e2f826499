import re

import pytest

from support.core_device import CoreDevice
from support.virtual_line import VirtualLine
from wheelwire import __version__
from wheelwire.errors import DeviceRefused, LinkLost, ProtocolMismatch
from wheelwire.link.session import Phase
from wheelwire.simulation.bad_line import Impairment
from wheelwire_protocol.codec import PROTOCOL_VERSION, message_id, schema_hash
from wheelwire_protocol.codes import RefusalCode, SupervisorEvent, SupervisorState
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.types import (
    DeviceHello,
    Event,
    Hello,
    Hold,
    ParameterGet,
    ParameterSet,
    ParameterValue,
    Ping,
    Pong,
    Refuse,
    SetWheelVelocity,
    WheelState,
)

UNKNOWN_PARAMETER = 200


def test_a_session_opens_with_a_known_clock_rate_and_parameters() -> None:
    line = VirtualLine(stream_rate_hz=200, watched=(1, 6)).open()
    count = len(line.samples)
    line.run(1.0)
    assert len(line.samples) - count == pytest.approx(200, abs=1)
    assert line.session.reported.values == pytest.approx({1: 0.033, 6: 0.4})
    assert len(line.sent_of(Ping)) >= 8
    assert line.session.device is not None
    assert line.session.device.release.release == __version__
    assert line.session.device.board_id == "240ac4123456"


def test_a_session_opens_on_a_line_that_is_slow_to_answer() -> None:
    slow = Impairment(delay_us=350_000)
    line = VirtualLine(to_device=slow, to_host=slow, stream_rate_hz=100, watched=(1,))
    line.session.connect(line.now_us)
    line.run_until(lambda: bool(line.samples), timeout_s=10.0)
    line.run(5.0)
    assert line.statistics.sessions == 1


def test_hello_is_repeated_with_one_nonce_until_answered() -> None:
    line = VirtualLine()
    line.device.mute = True
    line.session.connect(line.now_us)
    line.run(0.45)
    hellos = line.sent_of(Hello)
    assert 10 <= len(hellos) <= 20
    assert len(set(hellos)) == 1
    line.device.mute = False
    line.wait_open()


@pytest.mark.parametrize(
    ("difference", "code"),
    [("protocol_version", RefusalCode.PROTOCOL_VERSION), ("schema_hash", RefusalCode.SCHEMA)],
)
def test_a_mismatch_names_both_sides_and_opens_nothing(difference: str, code: RefusalCode) -> None:
    theirs = {"protocol_version": PROTOCOL_VERSION, "schema_hash": schema_hash(), difference: 77}
    release = {"version_major": 9, "version_minor": 8, "version_patch": 7, "refusal": code}
    line = VirtualLine(device=CoreDevice(edits={DeviceHello: {**theirs, **release}}))
    line.session.connect(line.now_us)
    line.run_until(lambda: isinstance(line.session.error, ProtocolMismatch))
    text = str(line.session.error)
    assert __version__ in text
    assert f"{schema_hash():08x}" in text
    assert f"{theirs['schema_hash']:08x}" in text
    assert f"protocol {theirs['protocol_version']}" in text
    assert re.search(r"9\.8\.7.*install both", text)
    with pytest.raises(ProtocolMismatch):
        line.drive()
    assert line.sent_of(SetWheelVelocity) == []


def test_a_booting_device_is_greeted_again() -> None:
    device = CoreDevice(edits={DeviceHello: {"refusal": RefusalCode.BOOTING}})
    line = VirtualLine(device=device)
    line.session.connect(line.now_us)
    line.run(0.25)
    assert len(line.sent_of(Hello)) > 2
    with pytest.raises(LinkLost, match="starting"):
        line.drive()
    device.edits.clear()
    line.wait_open()


def test_answers_of_another_session_are_ignored_and_counted() -> None:
    line = VirtualLine(watched=(1,)).open()
    foreign = line.statistics.foreign
    other = line.device.session_id ^ 1
    line.device.send(ParameterValue(other, 1, 1, 99.0))
    line.device.send(Refuse(other, message_id(SetWheelVelocity), RefusalCode.ESTOPPED, 1))
    line.run(0.01)
    assert line.statistics.foreign == foreign + 2
    assert line.session.reported.values[1] == pytest.approx(0.033)
    line.drive()
    line.device.mute = True
    outcomes = line.post(ParameterGet(0, 0, 1))
    line.run(0.01)
    asked = line.sent_of(ParameterGet)[-1]
    line.device.send(ParameterValue(other, asked.request_id, 1, 99.0))
    line.run(0.01)
    assert outcomes == []


def test_a_reset_is_reported_and_a_new_session_follows() -> None:
    line = VirtualLine(stream_rate_hz=50, watched=(1,)).open()
    line.drive()
    line.device.reset()
    outcomes = line.post(ParameterGet(0, 0, 2))
    line.run_until(lambda: line.session.phase is not Phase.OPEN)
    with pytest.raises(LinkLost, match="session"):
        line.drive()
    assert isinstance(outcomes[0], LinkLost)
    line.wait_open()
    assert line.samples[-1].boot_id == line.device.boot_id
    statistics = line.statistics
    assert (statistics.sessions, statistics.device_resets) == (2, 1)
    line.drive(0.0, 0.0)
    line.run(0.05)
    assert line.device.obeyed[-1].command_seq == 1


def test_the_reset_is_found_soon_though_the_first_answer_is_lost(line: VirtualLine) -> None:
    line.device.reset()
    line.to_host.impairment.loss = 1.0
    line.run(0.12)
    line.to_host.impairment.loss = 0.0
    line.run_until(lambda: line.session.phase is not Phase.OPEN, timeout_s=0.03)


def test_a_silent_device_is_not_flooded(line: VirtualLine) -> None:
    line.device.mute = True
    sent = len(line.sent)
    line.run(1.0)
    assert 20 <= len(line.sent) - sent <= 50


def test_a_device_that_streams_nothing_is_asked_five_times_a_second(line: VirtualLine) -> None:
    line.device.lost |= {WheelState, Hold}
    line.run(1.0)
    pings = len(line.sent_of(Ping))
    line.run(10.0)
    assert len(line.sent_of(Ping)) - pings == pytest.approx(50, abs=2)


def test_an_event_behind_a_state_in_one_read_has_the_last_word(line: VirtualLine) -> None:
    line.device.lost.add(WheelState)
    line.run(0.1)
    line.device.send(line.device.state)
    line.device.estop(line.now_us)
    line.run(0.01)
    with pytest.raises(DeviceRefused, match="Emergency stop is latched"):
        line.drive()


def test_pings_are_half_a_second_apart_while_states_come(line: VirtualLine) -> None:
    pings = len(line.sent_of(Ping))
    line.run(10.0)
    assert len(line.sent_of(Ping)) - pings == pytest.approx(20, abs=1)


def test_a_state_frame_of_another_boot_is_followed_by_a_hello_at_once(line: VirtualLine) -> None:
    state = line.device.state
    line.device.send(state._replace(boot_id=state.boot_id ^ 1))
    hellos = len(line.sent_of(Hello))
    line.run(0.002)
    assert len(line.sent_of(Hello)) == hellos + 1


def test_a_late_state_frame_of_a_previous_boot_changes_nothing(line: VirtualLine) -> None:
    late = line.device.state
    line.reset_device()
    count = len(line.samples)
    sessions = line.statistics.sessions
    line.device.lost.add(WheelState)
    line.device.send(late)
    line.run(0.05)
    assert line.session.phase is Phase.OPEN
    assert line.statistics.sessions == sessions
    assert len(line.samples) - count <= 1
    assert line.samples[-1].boot_id == line.device.boot_id


def test_silence_ends_the_session_and_the_answer_opens_a_new_one(line: VirtualLine) -> None:
    line.device.mute = True
    line.run(1.9)
    assert line.session.phase is Phase.OPEN
    line.run(0.2)
    with pytest.raises(LinkLost, match="silent"):
        line.drive()
    line.device.mute = False
    line.wait_open()
    assert line.statistics.device_resets == 0


def test_a_rate_that_the_device_refuses_raises() -> None:
    line = VirtualLine(stream_rate_hz=5000)
    line.session.connect(line.now_us)
    line.run_until(lambda: isinstance(line.session.error, DeviceRefused))
    assert line.session.phase is not Phase.OPEN
    hellos = len(line.sent_of(Hello))
    line.run(0.9)
    assert len(line.sent_of(Hello)) == hellos  # it does not storm the device
    line.run(0.2)
    assert len(line.sent_of(Hello)) > hellos


def test_sequence_numbers_restart_after_the_port_was_reopened(line: VirtualLine) -> None:
    line.run(1.0)
    line.session.disconnect(LinkLost("unplugged"))
    line.session.connect(line.now_us)
    line.wait_open()
    assert line.statistics.frames_lost == 0
    assert line.device.counters.seq_lost == 0


def test_after_a_reset_no_value_of_the_previous_boot_is_left() -> None:
    line = VirtualLine(watched=(1,)).open()
    line.device.reset()
    line.run_until(lambda: line.session.phase is Phase.PREPARING)
    assert line.session.reported.values == {}


def test_each_session_has_a_nonce_of_its_own(line: VirtualLine) -> None:
    line.reset_device()
    hellos = line.sent_of(Hello)
    assert hellos[-1].nonce != hellos[0].nonce


def test_a_value_is_active_once_its_change_is_confirmed() -> None:
    line = VirtualLine(watched=(1,)).open()
    found: list[object] = []

    def look(_answer: object) -> None:
        found.extend([line.session.reported.values[1], line.session.reported.watched_values])

    line.session.request(ParameterSet(0, 0, 1, 0.05), look, line.now_us)
    line.run(0.1)
    assert found == [pytest.approx(0.05), {1: pytest.approx(0.05)}]


def test_a_pong_for_another_session_sets_no_clock(line: VirtualLine) -> None:
    line.device.mute = True
    pings = len(line.sent_of(Ping))
    line.run_until(lambda: len(line.sent_of(Ping)) > pings)
    ping = line.sent_of(Ping)[-1]
    error_us = line.statistics.clock_error_us
    device_us = line.device.clock(line.now_us) + 9_000_000
    other = line.device.session_id ^ 1
    line.device.send(Pong(other, ping.request_id, ping.host_us, device_us, device_us))
    line.run(0.001)
    assert line.statistics.clock_error_us >= error_us


def test_an_event_of_a_previous_boot_keeps_nobody_from_driving(line: VirtualLine) -> None:
    t_us = line.device.clock(line.now_us) & 0xFFFFFFFF
    states = SupervisorState.IDLE, SupervisorState.ESTOPPED
    late = Event(line.device.boot_id, t_us, 0, SupervisorEvent.ESTOP, *states, 0, 0.0)
    line.reset_device()
    line.device.lost.add(WheelState)
    line.run(0.05)
    line.device.send(late)
    line.run(0.005)
    line.drive(0.0, 0.0)
    line.drive()


def test_the_answer_to_another_hosts_hello_opens_no_session() -> None:
    line = VirtualLine()
    line.to_device.impairment.loss = 1.0
    line.session.connect(line.now_us)
    line.run(0.01)
    hello = line.sent_of(Hello)[0]
    theirs = hello._replace(nonce=hello.nonce ^ 1)
    line.device.feed(Encoder().encode(theirs), line.now_us)
    line.run(0.1)
    assert line.session.phase is Phase.HELLO
    assert line.statistics.foreign > 0


def test_what_a_device_says_to_others_does_not_keep_a_session_alive(line: VirtualLine) -> None:
    line.device.mute = True
    for _ in range(5):
        line.device.send(ParameterValue(line.device.session_id ^ 1, 1, 1, 0.5))
        line.run(0.5)
    assert line.session.phase is Phase.HELLO


def test_a_session_refused_for_an_unforeseen_reason_does_not_open() -> None:
    edits = {DeviceHello: {"refusal": RefusalCode.NOT_STOPPED}}
    line = VirtualLine(device=CoreDevice(edits=edits))
    line.session.connect(line.now_us)
    line.run(0.2)
    assert line.session.phase is Phase.HELLO
    assert isinstance(line.session.error, DeviceRefused)


def test_one_refusal_among_what_a_session_needs_keeps_it_closed() -> None:
    line = VirtualLine(watched=(UNKNOWN_PARAMETER,), stream_rate_hz=50)
    line.session.connect(line.now_us)
    line.run(0.5)
    assert line.session.phase is not Phase.OPEN
    assert isinstance(line.session.error, DeviceRefused)
