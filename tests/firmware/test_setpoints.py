"""Setpoints: what is obeyed, for how long, and what is refused."""

from __future__ import annotations

import math

import pytest

from support.raw import RawHost
from wheelwire_protocol.codes import RefusalCode, StopMode, SupervisorState
from wheelwire_protocol.types import (
    Ack,
    Estop,
    Hello,
    Ping,
    Refuse,
    SetDuty,
    SetWheelVelocity,
    Stop,
)

PERIOD_US = 1000


@pytest.fixture
def host() -> RawHost:
    return RawHost().open()


def velocity(
    host: RawHost, seq: int, left: float = 0.2, right: float = 0.2, ttl_us: int = 300_000
) -> SetWheelVelocity:
    return SetWheelVelocity(host.session_id, seq, host.device_us + ttl_us, left, right)


def refusal(host: RawHost, message: SetWheelVelocity | SetDuty) -> RefusalCode:
    refuse = host.ask(message, Refuse)
    assert refuse.reference == message.command_seq
    return RefusalCode(refuse.code)


def test_drives_until_the_deadline_and_one_period_more_at_most(host: RawHost) -> None:
    message = velocity(host, 1)
    host.send(message)
    host.run_ms(200)
    assert host.sim.get("drive_on")
    assert host.state().supervisor == SupervisorState.DRIVING
    host.run_ms(300)
    assert not host.sim.get("drive_on")
    late_us = host.sim.get("drive_removed_us") - message.expiry_us
    assert 0 <= late_us <= PERIOD_US
    assert host.state().supervisor == SupervisorState.TIMED_OUT


def test_no_setpoint_lives_longer_than_ttl_max(host: RawHost) -> None:
    arrival_us = host.device_us
    host.send(velocity(host, 1, ttl_us=3_600_000_000))
    host.run_ms(1100)
    assert not host.sim.get("drive_on")
    assert host.sim.get("drive_removed_us") <= arrival_us + 1_000_000 + 2 * PERIOD_US


def test_a_repeat_gains_no_life(host: RawHost) -> None:
    message = velocity(host, 1)
    for _ in range(50):
        host.send(message)
        host.run_ms(10)
    assert not host.sim.get("drive_on")
    assert host.sim.get("drive_removed_us") <= message.expiry_us + PERIOD_US


def test_the_same_number_with_a_later_expiry_is_not_obeyed(host: RawHost) -> None:
    first = velocity(host, 1)
    host.send(first)
    host.run_ms(200)
    host.send(velocity(host, 1))
    host.run_ms(200)
    assert host.sim.get("drive_removed_us") <= first.expiry_us + PERIOD_US


def test_an_older_one_is_not_obeyed(host: RawHost) -> None:
    host.send(velocity(host, 5, 0.1, 0.1), velocity(host, 4, 0.4, 0.4))
    host.run_ms(20)
    assert host.state().command_seq == 5


def test_pings_and_hellos_keep_nothing_alive(host: RawHost) -> None:
    message = velocity(host, 1)
    host.send(message)
    for n in range(100):
        host.send(Ping(host.session_id, n + 2, 0))
        host.hello()
    assert not host.sim.get("drive_on")
    assert host.sim.get("drive_removed_us") <= message.expiry_us + PERIOD_US


def test_a_new_session_stops_the_robot(host: RawHost) -> None:
    host.send(velocity(host, 1))
    host.run_ms(100)
    assert host.sim.get("drive_on")
    host.hello(nonce=99)
    assert not host.sim.get("drive_on")


def test_before_the_clock_is_synchronised() -> None:
    host = RawHost()
    host.boot_id = host.hello().boot_id
    assert refusal(host, velocity(host, 1)) is RefusalCode.CLOCK_UNSYNCHRONISED
    assert not host.sim.get("drive_on")


def test_without_a_session() -> None:
    host = RawHost()
    assert refusal(host, velocity(host, 1)) is RefusalCode.NO_SESSION


def test_of_another_session(host: RawHost) -> None:
    message = velocity(host, 1)._replace(session_id=host.session_id ^ 1)
    assert refusal(host, message) is RefusalCode.NO_SESSION


@pytest.mark.parametrize("ttl_us", [0, -1, -1_000_000])
def test_expired_on_arrival(host: RawHost, ttl_us: int) -> None:
    host.run_ms(1500)
    assert refusal(host, velocity(host, 1, ttl_us=ttl_us)) is RefusalCode.EXPIRED


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_not_finite(host: RawHost, value: float) -> None:
    assert refusal(host, velocity(host, 1, left=value)) is RefusalCode.NOT_FINITE
    assert refusal(host, velocity(host, 2, right=value)) is RefusalCode.NOT_FINITE
    assert not host.sim.get("drive_on")


def test_beyond_the_limit_both_wheels_are_scaled_by_one_factor(host: RawHost) -> None:
    for seq in range(1, 100):
        host.send(velocity(host, seq, 0.25, 1e30 if seq < 3 else 0.55))
        host.run_ms(20)
    state = host.state()
    assert state.right_mps == pytest.approx(0.4, abs=0.02)
    assert state.left_mps == pytest.approx(0.4 * 0.25 / 0.55, abs=0.02)


def test_duty_is_obeyed_open_loop(host: RawHost) -> None:
    for seq in range(1, 50):
        host.send(SetDuty(host.session_id, seq, host.device_us + 300_000, 16384, -32768))
        host.run_ms(20)
    state = host.state()
    assert state.left_duty_q15 == 16383 or state.left_duty_q15 == 16384
    assert state.right_duty_q15 == -32767
    assert state.left_mps > 0.2
    assert state.right_mps < -0.4


def test_a_stop_voids_the_setpoints_up_to_its_number(host: RawHost) -> None:
    host.send(velocity(host, 3))
    host.run_ms(100)
    host.ask(Stop(host.session_id, 1, 5, StopMode.CONFIGURED), Ack)
    assert not host.sim.get("drive_on")
    host.send(velocity(host, 5))
    host.run_ms(20)
    assert not host.sim.get("drive_on")
    host.send(velocity(host, 6))
    host.run_ms(20)
    assert host.sim.get("drive_on")


def test_stop_and_estop_need_no_session(host: RawHost) -> None:
    host.send(velocity(host, 1))
    host.run_ms(100)
    host.ask(Stop(0, 7, 0, StopMode.COAST), Ack)
    assert not host.sim.get("drive_on")
    fresh = RawHost()
    ack = fresh.ask(Estop(0, 8), Ack)
    assert (ack.session_id, ack.request_id) == (0, 8)
    assert fresh.sim.get("state") == SupervisorState.ESTOPPED


def test_braking_stops_shorter_than_coasting() -> None:
    metres = {}
    for mode in (StopMode.COAST, StopMode.BRAKE):
        host = RawHost().open()
        host.send(velocity(host, 1, 0.3, 0.3, ttl_us=900_000))
        host.run_ms(600)
        begin_m = host.sim.get("true.x_m")
        host.send(Stop(host.session_id, 1, 1, mode))
        host.run_ms(2000)
        metres[mode] = host.sim.get("true.x_m") - begin_m
    assert 0 < metres[StopMode.BRAKE] < 0.8 * metres[StopMode.COAST]


def test_another_schema_or_version_opens_no_session() -> None:
    host = RawHost()
    from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
    from wheelwire_protocol.types import DeviceHello

    answer = host.ask(Hello(1, PROTOCOL_VERSION, schema_hash() ^ 1), DeviceHello)
    assert answer.refusal == RefusalCode.SCHEMA
    assert answer.schema_hash == schema_hash()
    answer = host.ask(Hello(1, PROTOCOL_VERSION + 1, schema_hash()), DeviceHello)
    assert answer.refusal == RefusalCode.PROTOCOL_VERSION
    host.boot_id = answer.boot_id
    assert refusal(host, velocity(host, 1)) is RefusalCode.NO_SESSION
