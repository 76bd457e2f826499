"""Requests: answered, done once, refused with a reason; parameters kept; the stream's rate."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from zlib import crc32

import pytest

from support.raw import RawHost
from wheelwire_protocol.codes import EventCode, Fault, RefusalCode, ResetReason, SupervisorState
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, PARAMETERS
from wheelwire_protocol.types import (
    Ack,
    AnyMessage,
    ClearEstop,
    ClearFault,
    Event,
    LinkCounters,
    LinkCountersGet,
    ParameterEntry,
    ParameterGet,
    ParameterList,
    ParameterReset,
    ParameterSave,
    ParameterSet,
    ParameterValue,
    Refuse,
    SetStreamRate,
    SetWheelVelocity,
    WheelState,
)

RADIUS = PARAMETER_BY_NAME["wheel_radius"].id
STOP_MODE = PARAMETER_BY_NAME["stop_mode"].id


@pytest.fixture
def host() -> RawHost:
    return RawHost().open()


def refusal(host: RawHost, message: AnyMessage) -> RefusalCode:
    return RefusalCode(host.ask(message, Refuse).code)


def get(host: RawHost, request_id: int, parameter: int = RADIUS) -> float:
    return host.ask(ParameterGet(host.session_id, request_id, parameter), ParameterValue).value


def set_radius(host: RawHost, request_id: int, value: float) -> ParameterSet:
    return ParameterSet(host.session_id, request_id, RADIUS, value)


def test_a_repeat_is_answered_again_and_not_done_again(host: RawHost) -> None:
    first = set_radius(host, 1, 0.04)
    answer = host.ask(first, ParameterValue)
    host.ask(set_radius(host, 2, 0.05), ParameterValue)
    assert host.ask(first, ParameterValue) == answer
    assert get(host, 3) == pytest.approx(0.05)


def test_a_refusal_is_repeated_too(host: RawHost) -> None:
    message = set_radius(host, 1, 99)
    assert refusal(host, message) is RefusalCode.OUT_OF_RANGE
    assert refusal(host, message) is RefusalCode.OUT_OF_RANGE
    counters = host.ask(LinkCountersGet(host.session_id, 2), LinkCounters)
    assert counters.refused == 1


def test_a_repeat_older_than_the_cache_is_dropped(host: RawHost) -> None:
    for request_id in range(1, 8):
        host.ask(set_radius(host, request_id, 0.04 + request_id / 1000), ParameterValue)
    host.received.clear()
    host.send(set_radius(host, 1, 0.041))
    host.run_ms(20)
    assert not host.of(ParameterValue)
    assert get(host, 8) == pytest.approx(0.047)


def test_of_another_session(host: RawHost) -> None:
    message = set_radius(host, 1, 0.05)._replace(session_id=host.session_id ^ 1)
    assert refusal(host, message) is RefusalCode.NO_SESSION
    assert get(host, 2) == pytest.approx(0.033)


@pytest.mark.parametrize(
    ("parameter", "value", "code"),
    [
        (RADIUS, math.nan, RefusalCode.NOT_FINITE),
        (RADIUS, math.inf, RefusalCode.NOT_FINITE),
        (RADIUS, 5.0, RefusalCode.OUT_OF_RANGE),
        (RADIUS, -0.1, RefusalCode.OUT_OF_RANGE),
        (STOP_MODE, 1.5, RefusalCode.NOT_INTEGRAL),
        (0, 1.0, RefusalCode.UNKNOWN_PARAMETER),
        (200, 1.0, RefusalCode.UNKNOWN_PARAMETER),
    ],
)
def test_bad_values_are_refused(
    host: RawHost, parameter: int, value: float, code: RefusalCode
) -> None:
    assert refusal(host, ParameterSet(host.session_id, 1, parameter, value)) is code
    assert get(host, 2) == pytest.approx(0.033)


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


def test_saved_values_survive_a_reset_and_others_do_not(host: RawHost) -> None:
    host.ask(set_radius(host, 1, 0.05), ParameterValue)
    host.ask(ParameterSave(host.session_id, 2, 0), Ack)
    host.ask(set_radius(host, 3, 0.06), ParameterValue)
    host.reset()
    assert get(host, 1) == pytest.approx(0.05)
    host.ask(ParameterReset(host.session_id, 2), Ack)
    assert get(host, 3) == pytest.approx(0.033)
    host.reset()
    assert get(host, 1) == pytest.approx(0.033)


def test_one_value_is_saved_and_others_stay_as_they_were_saved(host: RawHost) -> None:
    """A value that was only tried is not kept by saving another one."""
    separation = PARAMETER_BY_NAME["wheel_separation"].id
    host.ask(set_radius(host, 1, 0.05), ParameterValue)
    host.ask(ParameterSave(host.session_id, 2, 0), Ack)
    host.ask(set_radius(host, 3, 0.06), ParameterValue)
    host.ask(ParameterSet(host.session_id, 4, separation, 0.3), ParameterValue)
    host.ask(ParameterSave(host.session_id, 5, separation), Ack)
    host.reset()
    assert get(host, 1) == pytest.approx(0.05)
    entry = host.ask(ParameterGet(host.session_id, 2, separation), ParameterValue)
    assert entry.value == pytest.approx(0.3)


def test_one_value_is_saved_to_an_empty_store(host: RawHost) -> None:
    max_duty = PARAMETER_BY_NAME["max_duty"].id
    host.ask(ParameterSet(host.session_id, 1, max_duty, 0.5), ParameterValue)
    host.ask(set_radius(host, 2, 0.05), ParameterValue)
    host.ask(ParameterSave(host.session_id, 3, PARAMETER_BY_NAME["wheel_radius"].id), Ack)
    host.reset()
    assert get(host, 1) == pytest.approx(0.05)
    entry = host.ask(ParameterGet(host.session_id, 2, max_duty), ParameterValue)
    assert entry.value == 1.0


def test_no_parameter_that_is_not_there_is_saved(host: RawHost) -> None:
    message = ParameterSave(host.session_id, 1, len(PARAMETERS) + 1)
    assert refusal(host, message) is RefusalCode.UNKNOWN_PARAMETER


@pytest.mark.parametrize(
    "message", [ParameterSave(0, 1, 0), ParameterSave(0, 1, 1), ParameterReset(0, 1)]
)
def test_the_store_is_not_touched_while_driving(
    host: RawHost, message: ParameterSave | ParameterReset
) -> None:
    host.send(SetWheelVelocity(host.session_id, 1, host.device_us + 500_000, 0.2, 0.2))
    host.run_ms(50)
    message = message._replace(session_id=host.session_id)
    assert refusal(host, message) is RefusalCode.NOT_STOPPED
    assert host.state().supervisor == SupervisorState.DRIVING


def test_a_failing_store_is_reported(host: RawHost) -> None:
    host.sim.set("store_failing", 1)
    assert refusal(host, ParameterSave(host.session_id, 1, 0)) is RefusalCode.STORE_FAILED


@pytest.mark.parametrize(("write", "kept"), [(1, 0.05), (2, 0.06)])
def test_a_power_cut_in_a_save_leaves_the_old_values_or_the_new_ones(
    host: RawHost, write: int, kept: float
) -> None:
    host.ask(set_radius(host, 1, 0.05), ParameterValue)
    host.ask(ParameterSave(host.session_id, 2, 0), Ack)
    host.ask(set_radius(host, 3, 0.06), ParameterValue)
    boot_id = host.sim.get("boot_id")
    host.sim.set("power_cut_at_write", write)
    host.send(ParameterSave(host.session_id, 4, 0))
    host.run_ms(100)
    assert host.sim.get("boot_id") != boot_id
    assert host.sim.get("reset") == ResetReason.POWER_ON
    host.open()
    assert [event.code for event in host.of(Event)] == [EventCode.PARAMETERS_COPY_LOST]
    assert get(host, 1) == pytest.approx(kept)
    assert host.state().faults == 0


SLOTS = (4 + 2, 4 + 1024 + 2)
"""Where the simulator's file has the first byte of what is in each of its two slots."""


def damage(store: Path, slots: tuple[int, ...]) -> None:
    content = bytearray(store.read_bytes())
    for slot in slots:
        content[SLOTS[slot]] ^= 0x40
    store.write_bytes(content)


def robot_that_saved(store: Path, *radii: float) -> None:
    host = RawHost(store=store).open()
    assert [event.code for event in host.of(Event)] == [EventCode.STORE_EMPTY]
    for number, radius in enumerate(radii):
        host.ask(set_radius(host, 2 * number + 1, radius), ParameterValue)
        host.ask(ParameterSave(host.session_id, 2 * number + 2, 0), Ack)


@pytest.mark.parametrize("slot", [0, 1])
def test_a_damaged_slot_is_reported_and_repaired_at_rest(tmp_path: Path, slot: int) -> None:
    store = tmp_path / "store"
    robot_that_saved(store, 0.05, 0.06)
    damage(store, (slot,))
    host = RawHost(store=store).open()
    assert [event.code for event in host.of(Event)] == [EventCode.PARAMETERS_COPY_LOST]
    assert get(host, 1) == pytest.approx(0.06)
    assert host.state().faults == 0
    host.run_ms(5000)
    damage(store, (1 - slot,))
    host = RawHost(store=store).open()
    assert [event.code for event in host.of(Event)] == [EventCode.PARAMETERS_COPY_LOST]
    assert get(host, 1) == pytest.approx(0.06)


def gone(store: Path) -> None:
    """As where NVS has erased both slots, for each had a bit that flipped."""
    store.unlink()


def both_slots(store: Path) -> None:
    damage(store, (0, 1))


def no_store(store: Path) -> None:
    store.write_bytes(b"of something else")


def of_an_earlier_firmware(store: Path) -> None:
    block = b"WWP1" + bytes(10)
    store.write_bytes(block + crc32(block).to_bytes(4, "little"))


DAMAGES: list[tuple[Callable[[Path], None], Fault]] = [
    (gone, Fault.STORE_UNREADABLE),
    (both_slots, Fault.STORE_UNREADABLE),
    (no_store, Fault.STORE_UNREADABLE),
    (of_an_earlier_firmware, Fault.STORE_OUTDATED),
]


@pytest.mark.parametrize("cure", [ParameterReset(0, 3), ParameterSave(0, 3, 0)])
@pytest.mark.parametrize(("do_damage", "fault"), DAMAGES)
def test_if_no_saved_copy_is_whole_nothing_drives_until_it_is_written_again(
    tmp_path: Path,
    do_damage: Callable[[Path], None],
    fault: Fault,
    cure: ParameterReset | ParameterSave,
) -> None:
    store = tmp_path / "store"
    robot_that_saved(store, 0.05)
    do_damage(store)
    host = RawHost(store=store).open()
    host.run_ms(50)
    assert host.state().supervisor == SupervisorState.FAULT
    assert host.state().faults == fault
    assert get(host, 1) == pytest.approx(0.033)
    assert refusal(host, ClearFault(host.session_id, 2)) is RefusalCode.CAUSE_PRESENT
    # It would reset all others to defaults.
    one = ParameterSave(host.session_id, 5, 1)
    assert refusal(host, one) is RefusalCode.STORE_FAILED
    host.ask(cure._replace(session_id=host.session_id, request_id=6), Ack)
    host.ask(ClearFault(host.session_id, 7), Ack)
    host = RawHost(store=store).open()
    told = [EventCode.STORE_EMPTY] if isinstance(cure, ParameterReset) else []
    assert [event.code for event in host.of(Event)] == told
    host.run_ms(50)
    assert host.state().supervisor == SupervisorState.IDLE


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


@pytest.mark.parametrize("rate_hz", [1000, 333, 100, 10])
def test_the_rate_asked_is_the_rate_had(host: RawHost, rate_hz: int) -> None:
    host.ask(SetStreamRate(host.session_id, 1, rate_hz), Ack)
    host.run_ms(100)
    host.received.clear()
    host.run_ms(2000)
    assert len(host.of(WheelState)) == pytest.approx(2 * rate_hz, abs=1)


def test_a_stream_can_be_switched_off(host: RawHost) -> None:
    host.ask(SetStreamRate(host.session_id, 1, 0), Ack)
    host.received.clear()
    host.run_ms(500)
    assert not host.of(WheelState)


def test_more_than_the_loop_or_the_line_carries_is_refused(host: RawHost) -> None:
    message = SetStreamRate(host.session_id, 1, 1001)
    assert refusal(host, message) is RefusalCode.RATE_TOO_HIGH
    host.sim.set("baud_rate", 115_200)
    host.received.clear()
    host.send(SetStreamRate(host.session_id, 2, 300))
    host.run_ms(100)
    assert [refuse.code for refuse in host.of(Refuse)] == [RefusalCode.RATE_TOO_HIGH]
    host.send(SetStreamRate(host.session_id, 3, 180))
    host.run_ms(100)
    host.received.clear()
    host.run_ms(2000)
    assert len(host.of(WheelState)) == pytest.approx(360, abs=1)


def test_clearing_what_is_not_latched_is_no_error(host: RawHost) -> None:
    host.ask(ClearEstop(host.session_id, 1), Ack)
    assert host.state().supervisor == SupervisorState.IDLE


def test_transitions_are_reported_as_events(host: RawHost) -> None:
    host.received.clear()
    host.send(SetWheelVelocity(host.session_id, 1, host.device_us + 100_000, 0.2, 0.2))
    host.run_ms(200)
    reported = [(event.before, event.after) for event in host.of(Event)]
    assert reported == [
        (SupervisorState.IDLE, SupervisorState.DRIVING),
        (SupervisorState.DRIVING, SupervisorState.TIMED_OUT),
    ]
