"""Setpoints: what is obeyed, for how long, and what is refused."""

from __future__ import annotations

import math

import pytest

from support.raw import RawHost
from wheelwire_protocol.codes import RefusalCode, SupervisorState
from wheelwire_protocol.types import (
    Hello,
    Ping,
    Refuse,
    SetDuty,
    SetWheelVelocity,
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


def test_a_repeat_gains_no_life(host: RawHost) -> None:
    message = velocity(host, 1)
    for _ in range(50):
        host.send(message)
        host.run_ms(10)
    assert not host.sim.get("drive_on")
    assert host.sim.get("drive_removed_us") <= message.expiry_us + PERIOD_US


def test_pings_and_hellos_keep_nothing_alive(host: RawHost) -> None:
    message = velocity(host, 1)
    host.send(message)
    for n in range(100):
        host.send(Ping(host.session_id, n + 2, 0))
        host.hello()
    assert not host.sim.get("drive_on")
    assert host.sim.get("drive_removed_us") <= message.expiry_us + PERIOD_US


def test_before_the_clock_is_synchronised() -> None:
    host = RawHost()
    assert refusal(host, velocity(host, 1)) is RefusalCode.NO_SESSION
    host.boot_id = host.hello().boot_id
    assert refusal(host, velocity(host, 1)) is RefusalCode.CLOCK_UNSYNCHRONISED
    assert not host.sim.get("drive_on")


def test_what_drives_nothing_is_refused(host: RawHost) -> None:
    host.run_ms(1500)
    another = velocity(host, 1)._replace(session_id=host.session_id ^ 1)
    assert refusal(host, another) is RefusalCode.NO_SESSION
    for seq, ttl_us in enumerate((0, -1, -1_000_000), 2):
        assert refusal(host, velocity(host, seq, ttl_us=ttl_us)) is RefusalCode.EXPIRED
    for seq, value in enumerate((math.nan, math.inf, -math.inf), 5):
        left, right = velocity(host, 2 * seq, left=value), velocity(host, 2 * seq + 1, right=value)
        assert refusal(host, left) is RefusalCode.NOT_FINITE
        assert refusal(host, right) is RefusalCode.NOT_FINITE
    assert not host.sim.get("drive_on")


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
