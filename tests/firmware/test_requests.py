"""Requests: answered, done once, refused with a reason; parameters kept; the stream's rate."""

from __future__ import annotations

import pytest

from support.raw import RawHost
from wheelwire_protocol.codes import Fault, RefusalCode, SupervisorState
from wheelwire_protocol.parameters import PARAMETERS
from wheelwire_protocol.types import (
    Ack,
    AnyMessage,
    ClearFault,
    Event,
    ParameterEntry,
    ParameterList,
    ParameterReset,
    ParameterSave,
    Refuse,
    SetStreamRate,
    SetWheelVelocity,
    WheelState,
)


@pytest.fixture
def host() -> RawHost:
    return RawHost().open()


def refusal(host: RawHost, message: AnyMessage) -> RefusalCode:
    return RefusalCode(host.ask(message, Refuse).code)


def test_the_list_is_the_table(host: RawHost) -> None:
    for index, parameter in enumerate(PARAMETERS):
        entry = host.ask(ParameterList(host.session_id, index + 1, index), ParameterEntry)
        assert entry.parameter_count == len(PARAMETERS)
        assert entry.parameter == parameter.id
        assert entry.value == pytest.approx(parameter.default)
        assert (entry.minimum, entry.maximum) == pytest.approx(
            (parameter.minimum, parameter.maximum)
        )
    message = ParameterList(host.session_id, 100, len(PARAMETERS))
    assert refusal(host, message) is RefusalCode.OUT_OF_RANGE


@pytest.mark.parametrize("found", [Fault.STORE_FULL, Fault.STORE_NEWER, Fault.STORE_UNREADABLE])
def test_a_store_that_cannot_be_read_lets_nothing_drive(host: RawHost, found: Fault) -> None:
    host.ask(ParameterSave(host.session_id, 1, 0), Ack)
    host.sim.set("store_unreadable", found)
    host.reset()
    host.run_ms(50)
    assert host.state().supervisor == SupervisorState.FAULT
    assert host.state().faults == found
    setpoint = SetWheelVelocity(host.session_id, 1, host.device_us + 500_000, 0.2, 0.2)
    assert refusal(host, setpoint) is RefusalCode.FAULT
    assert refusal(host, ClearFault(host.session_id, 1)) is RefusalCode.CAUSE_PRESENT
    assert refusal(host, ParameterSave(host.session_id, 2, 1)) is RefusalCode.STORE_FAILED
    host.ask(ParameterReset(host.session_id, 3), Ack)
    host.ask(ClearFault(host.session_id, 4), Ack)
    host.run_ms(20)
    assert host.state().supervisor == SupervisorState.IDLE
    host.ask(ParameterSave(host.session_id, 5, 0), Ack)


def test_the_rate_asked_is_the_rate_had(host: RawHost) -> None:
    for request_id, rate_hz in enumerate((1000, 333, 100, 10), 1):
        host.ask(SetStreamRate(host.session_id, request_id, rate_hz), Ack)
        host.run_ms(100)
        host.received.clear()
        host.run_ms(2000)
        assert len(host.of(WheelState)) == pytest.approx(2 * rate_hz, abs=1)
    host.ask(SetStreamRate(host.session_id, 5, 0), Ack)
    host.received.clear()
    host.run_ms(500)
    assert not host.of(WheelState)


def test_transitions_are_reported_as_events(host: RawHost) -> None:
    host.received.clear()
    host.send(SetWheelVelocity(host.session_id, 1, host.device_us + 100_000, 0.2, 0.2))
    host.run_ms(200)
    reported = [(event.before, event.after) for event in host.of(Event)]
    assert reported == [
        (SupervisorState.IDLE, SupervisorState.DRIVING),
        (SupervisorState.DRIVING, SupervisorState.TIMED_OUT),
    ]
